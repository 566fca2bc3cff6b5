// SPDX-License-Identifier: Apache-2.0
// write_seeds FOLDER: files to begin with for the targets that would not find a sound file by themselves.
#include <filesystem>
#include <fstream>

#include "e57_sample.h"
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

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) return 2;
  put_las(arguments[1]);
  put_e57(arguments[1]);
}
