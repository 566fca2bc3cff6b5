// SPDX-License-Identifier: Apache-2.0
// The clouds of training/net/golden.py: what the net reads of each point, and where the integer reference puts it.
#pragma once

#include <cstring>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "seam/refinement.hpp"
#include "shapes.h"

namespace pointfair::learned_clouds {

inline const std::string kWeightsFile = std::string(POINTFAIR_SOURCE_DIR) + "/src/learned/weights.bin";

inline std::vector<std::byte> bytes_of(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::vector<char> chars{std::istreambuf_iterator<char>(file), {}};
  std::vector<std::byte> bytes(chars.size());
  std::memcpy(bytes.data(), chars.data(), chars.size());
  return bytes;
}

struct Golden {
  Frame frame;
  shapes::Points measured, classical, normals, refined;
  std::vector<float> noise;
  std::vector<std::uint8_t> held;

  Classical input() const { return {measured, classical, normals, noise, held}; }
};

inline std::vector<Golden> golden_clouds() {
  const std::vector<std::byte> bytes = bytes_of(POINTFAIR_SOURCE_DIR "/tests/learned/clouds.bin");
  std::vector<Golden> clouds;
  for (std::size_t at = 0; at < bytes.size();) {
    std::uint32_t count = 0;
    std::memcpy(&count, bytes.data() + at, sizeof count);
    std::vector<float> numbers(3 + 13 * std::size_t(count));
    std::memcpy(numbers.data(), bytes.data() + at + sizeof count, numbers.size() * sizeof(float));
    at += sizeof count + numbers.size() * sizeof(float);
    Golden cloud;
    cloud.frame.corner = {numbers[0], numbers[1], numbers[2]};
    const auto point_at = [&](std::size_t n) { return Point{numbers[n], numbers[n + 1], numbers[n + 2]}; };
    for (std::size_t n = 3; n < numbers.size(); n += 13) {
      cloud.measured.push_back(point_at(n));
      cloud.classical.push_back(point_at(n + 3));
      cloud.normals.push_back(point_at(n + 6));
      cloud.noise.push_back(numbers[n + 9]);
      cloud.refined.push_back(point_at(n + 10));
    }
    cloud.held.resize(count);
    clouds.push_back(std::move(cloud));
  }
  return clouds;
}

inline std::size_t differing(const shapes::Points& a, const shapes::Points& b) {
  std::size_t different = a.size() != b.size();
  for (std::size_t i = 0; i < a.size() && i < b.size(); ++i) different += std::memcmp(&a[i], &b[i], sizeof(Point)) != 0;
  return different;
}

}  // namespace pointfair::learned_clouds
