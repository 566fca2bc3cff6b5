// SPDX-License-Identifier: Apache-2.0
// write_messages FOLDER: messages as the server writes them, each beside the numbers it holds in JSON;
// protocol.test.mjs reads both.
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <limits>
#include <random>

#include "viewer/message.hpp"
#include "viewer/quantise.hpp"

namespace {

namespace fs = std::filesystem;
using namespace pointfair;
using namespace pointfair::viewer;

void write_file(const fs::path& path, const void* data, std::size_t bytes) {
  std::ofstream(path, std::ios::binary).write(static_cast<const char*>(data), static_cast<std::streamsize>(bytes));
}

template <class T>
Json list_of(const std::vector<T>& values) {
  Json list = Json::array();
  for (const T value : values) list.push_back(value);
  return list;
}

void write_case(const fs::path& folder, const std::string& name, const Json& head, const std::vector<Array>& arrays,
                const Json& expected) {
  const Bytes message = pack(head, arrays);
  const std::string text = Json{{"head", head}, {"arrays", expected}}.dump();
  write_file(folder / (name + ".bin"), message.data(), message.size());
  write_file(folder / (name + ".json"), text.data(), text.size());
}

// Array lengths around the padding, texts of every length modulo 8.
void write_layouts(const fs::path& folder) {
  for (int n = 0; n < 9; ++n) {
    std::vector<float> floats;
    std::vector<std::int16_t> shorts;
    std::vector<std::uint8_t> bytes;
    std::vector<std::uint32_t> words;
    for (int i = 0; i < n; ++i) {
      floats.push_back(1.5f * float(i) - 2);
      shorts.push_back(std::int16_t(i * 9000 - 32768));
      bytes.push_back(std::uint8_t(31 * i));
      words.push_back(0xffffffffu - unsigned(i));
    }
    const Json head{{"type", "test"}, {"text", std::string(std::size_t(n), 'x') + "\u00e4\"\\\n"}, {"number", 0.1 * n}};
    write_case(folder, "layout" + std::to_string(n), head,
               {make_array("bytes", bytes), make_array("floats", floats), make_array("shorts", shorts),
                make_array("words", words)},
               {{"bytes", list_of(bytes)},
                {"floats", list_of(floats)},
                {"shorts", list_of(shorts)},
                {"words", list_of(words)}});
  }
}

// Normals, and what they decode to here.
void write_normals(const fs::path& folder) {
  std::mt19937 random(5);
  std::normal_distribution<float> gauss;
  std::vector<Point> normals{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}, {0, 0, 0}};
  for (int i = 0; i < 500; ++i) {
    const Point n{gauss(random), gauss(random), gauss(random)};
    const float length = std::hypot(n.x, n.y, n.z);
    normals.push_back({n.x / length, n.y / length, n.z / length});
  }
  std::vector<std::int16_t> pairs;
  Json decoded = Json::array();
  for (const Point& n : normals) {
    const OctNormal oct = encode_normal(n);
    pairs.insert(pairs.end(), {oct.u, oct.v});
    const Point back = decode_normal(oct);
    decoded.push_back({back.x, back.y, back.z});
  }
  write_case(folder, "normals", {{"type", "normals"}}, {make_array("normals", pairs)}, {{"decoded", decoded}});
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: write_messages FOLDER\n";
    return 2;
  }
  write_layouts(argv[1]);
  write_normals(argv[1]);
  return 0;
}
