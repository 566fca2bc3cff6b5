// SPDX-License-Identifier: Apache-2.0
// Prints a hash of the result's bits for a few runs, and on standard error the device. On the public headers only, so
// that it builds inside the tree and against the installed package alike; both must print the same.
#include <bit>
#include <cmath>
#include <cstdint>
#include <iostream>
#include <pointfair/pointfair.hpp>
#include <string_view>
#include <vector>

namespace {

using pointfair::Length;
using pointfair::Params;
using pointfair::Point;

std::uint64_t hash(const std::vector<Point>& points) {  // FNV-1a over words
  std::uint64_t h = 0xcbf29ce484222325u;
  for (const Point& p : points)
    for (const float value : {p.x, p.y, p.z}) h = (h ^ std::bit_cast<std::uint32_t>(value)) * 0x100000001b3u;
  return h;
}

// A rough sphere: a lattice of steps that never repeats, without any function whose last bit varies between libraries.
std::vector<Point> rough_sphere(int count) {
  std::vector<Point> points;
  std::uint32_t state = 1;
  const auto random = [&] { return float((state = state * 1664525u + 1013904223u) >> 8) * 0x1p-23f - 1.0f; };
  while (int(points.size()) < count) {
    const float x = random(), y = random(), z = random(), length = std::sqrt(x * x + y * y + z * z);
    const float radius = 1 + 0.01f * random();
    if (length > 0.1f && length < 1) points.push_back({radius * x / length, radius * y / length, radius * z / length});
  }
  points[count / 2].y = std::nanf("");
  return points;
}

void print(pointfair::Pipeline& pipeline, std::string_view name, const Params& params, std::size_t count) {
  std::vector<Point> out(count);
  pipeline.run(params, out);
  std::cout << name << ' ' << std::hex << hash(out);
  pipeline.normals(out);
  std::cout << ' ' << hash(out) << '\n';
}

}  // namespace

int main() {
  const std::vector<Point> points = rough_sphere(20000);
  pointfair::Pipeline pipeline(pointfair::Device::cpu);
  pipeline.load(points);
  print(pipeline, "paper", pointfair::paper_preset(), points.size());
  print(pipeline, "automatic", {}, points.size());
  for (const int k : {5, 16, 32, 100})
    print(pipeline, "list", {.k = k, .area_weight = pointfair::AreaWeight::length}, points.size());
  print(pipeline, "radius", {.radius = Length(4, Length::Unit::spacing)}, points.size());
  std::cerr << pipeline.device().name << '\n';
}
