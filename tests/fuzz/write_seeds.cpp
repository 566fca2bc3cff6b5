// SPDX-License-Identifier: Apache-2.0
// write_seeds FOLDER: files to begin with for the targets that would not find a sound file by themselves.
#include <filesystem>
#include <fstream>

#include "e57_sample.h"
#include "io/text.hpp"
#include "io_variants.h"
#include "laz_parts.h"

namespace {

namespace fs = std::filesystem;
using namespace pointfair;

void put(const fs::path& folder, const std::string& name, const std::string& bytes) {
  fs::create_directories(folder);
  std::ofstream(folder / name, std::ios::binary) << bytes;
}

void put_las(const fs::path& folder) {
  for (test::LasSpec spec : test::all_las_specs()) {
    spec.count = 12;
    spec.extended = false;
    const std::string name =
        std::to_string(spec.minor) + "_" + std::to_string(spec.format) + (spec.described ? "x" : "");
    const std::string las = test::make_las(spec);
    put(folder / "fuzz_las", name + ".las", las);
    put(folder / "fuzz_copc", name, las);
    const auto laz = write_bytes(fuzz::read_as(fuzz::as_bytes(las), Format::las), Format::laz);
    put(folder / "fuzz_las", name + ".laz", {reinterpret_cast<const char*>(laz.data()), laz.size()});
  }
  for (unsigned format = 0; format <= 10; ++format) {
    const fuzz::LazParts& parts = fuzz::parts_of(format);
    const std::string first(1, static_cast<char>(format)), points(1, static_cast<char>(fuzz::kLazPoints - 1));
    put(folder / "fuzz_laz_chunk", std::to_string(format), first + points + parts.chunk);
    put(folder / "fuzz_laz_table", std::to_string(format), first + parts.table);
  }
}

void put_e57(const fs::path& folder) {
  const std::string file = fuzz::e57_sample(), logical = fuzz::logical_bytes(file);
  put(folder / "fuzz_e57", "sample", logical);
  put(folder / "fuzz_e57_pages", "sample", file);
  put(folder / "fuzz_e57_xml", "sample",
      logical.substr(logical.find("<?xml"), logical.rfind('>') + 1 - logical.find("<?xml")));
}

// Formats whose first lines a fuzzer would hardly guess.
void put_scans_and_meshes(const fs::path& folder) {
  const std::string pose = "2\n1\n1 2 3\n1 0 0\n0 1 0\n0 0 1\n0.6 0.8 0 0\n-0.8 0.6 0 0\n0 0 1 0\n1 2 3 1\n";
  put(folder / "fuzz_ptx", "two", pose + "1 2 3 0.5\n0 0 0 0.5\n" + pose + "1 2 3 0.5 1 2 3\n4 5 6 0.25 4 5 6\n");
  const std::string facet =
      "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n";
  put(folder / "fuzz_stl", "text", "solid a\n" + facet + facet + "endsolid a\n");
  Cloud cloud{.points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}};
  const auto put_as = [&](Format format, const std::string& target, const std::string& name) {
    const auto bytes = write_bytes(cloud, format);
    put(folder / target, name, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  };
  put_as(Format::npy, "fuzz_npy", "plain");
  cloud.added.resize(1);
  cloud.added[0].name = "a";
  cloud.added[0].type = ScalarType::uint8;
  cloud.added[0].data.resize(3);
  put_as(Format::npy, "fuzz_npy", "records");
  cloud = fuzz::read_as(fuzz::as_bytes("solid a\n" + facet + "endsolid a\n"), Format::stl);
  put_as(Format::stl, "fuzz_stl", "binary");
  put(folder / "fuzz_glb", "embedded",
      R"({"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"scale":[2,1,1]}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],)"
      R"("accessors":[{"bufferView":0,"componentType":5121,"count":3,"type":"VEC3"}],"bufferViews":[{"buffer":0,"byteLength":12}],)"
      R"("buffers":[{"byteLength":12,"uri":"data:a;base64,AAAAAQAAAAEAAAAA"}]})");
}

// As people write them; the formats of tables are fuzzed with all of those.
void put_cases(const fs::path& folder) {
  int number = 0;
  for (const test::Given& given : test::all_files()) {
    const std::string name = std::to_string(number++),
                      extension = io::lower_case(fs::path(given.name).extension().string());
    const bool is_table =
        extension == ".asc" || extension == ".csv" || extension == ".txt" || extension.starts_with(".xyz");
    if (is_table) {
      for (const char* const target : {"fuzz_csv", "fuzz_xyz", "fuzz_new_files"})
        put(folder / target, name, given.bytes);
    } else {
      put(folder / ("fuzz_" + extension.substr(1)), name, given.bytes);
    }
    put(folder / "fuzz_new_files", "written_" + name, given.csv);
  }
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) return 2;
  put_las(arguments[1]);
  put_e57(arguments[1]);
  put_scans_and_meshes(arguments[1]);
  put_cases(arguments[1]);
}
