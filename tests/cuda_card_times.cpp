// SPDX-License-Identifier: Apache-2.0
// Times runs of a cloud in host memory on one card against several, from array to array.
//   cuda_card_times POINTS K|auto REPEAT MEGABYTES [lines|random] [ordinary] DEVICE...
// For each order of the points, scan lines and random, and each device, cuda:0 or cuda:0,1 for instance: the median and
// the least of REPEAT runs in milliseconds after one that is not counted, the tiles, each stage of the last run, and a
// hash of the result, which is the same for all devices. Arrays are page-locked unless `ordinary`. Each of the two
// workers of a card uses MEGABYTES of its memory at most, 0: all, so that a cloud of any size can be one that does not
// fit.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <thread>
#include <vector>

#include "pipeline/pipeline_access.hpp"
#include "pointfair/pointfair.hpp"
#include "seam/backend.hpp"

namespace {

using namespace pointfair;
using Clock = std::chrono::steady_clock;

template <class Body>
void for_parts(std::size_t count, const Body& body) {
  const std::size_t parts = std::max(1u, std::thread::hardware_concurrency());
  std::vector<std::jthread> threads;
  for (std::size_t part = 0; part < parts; ++part)
    threads.emplace_back([=, &body] { body(part * count / parts, (part + 1) * count / parts); });
}

// In [-1, 1), the same for the same number.
double unit(std::uint64_t number) {
  number = (number ^ (number >> 30)) * 0xbf58476d1ce4e5b9u;  // the mixer of SplitMix64 (S. Vigna)
  number = (number ^ (number >> 27)) * 0x94d049bb133111ebu;
  return double((number ^ (number >> 31)) >> 11) * 0x1p-52 - 1;
}

// Hills in scan lines, with noise of a third of the spacing.
Point hill(std::uint64_t i, std::uint64_t width) {
  const double x = double(i % width) + 0.3 * unit(4 * i), y = double(i / width) + 0.3 * unit(4 * i + 1);
  const double z = 40 * std::sin(x / 70) * std::cos(y / 90) + 4 * std::sin(x / 9 + y / 13) +
                   0.3 * (unit(4 * i + 2) + unit(4 * i + 3));
  return {float(x), float(y), float(z)};
}

// `stride` has no factor with the number of points: 1 keeps scan lines.
void fill(std::span<Point> points, std::uint64_t stride) {
  const auto width = std::uint64_t(std::sqrt(double(points.size())));
  for_parts(points.size(), [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) points[i] = hill(std::uint64_t(i) * stride % points.size(), width);
  });
}

std::uint64_t hash_of(std::span<const Point> points) {
  std::uint64_t hash = 0xcbf29ce484222325u;  // FNV-1a of 32-bit words (G. Fowler, L. C. Noll, K.-P. Vo)
  for (const Point& p : points)
    for (const float c : {p.x, p.y, p.z}) {
      std::uint32_t bits = 0;
      std::memcpy(&bits, &c, sizeof bits);
      hash = (hash ^ bits) * 0x100000001b3u;
    }
  return hash;
}

Pipeline over(const std::string& name, std::uint64_t megabytes) {
  const Device device = parse_device(name);
  CudaOptions options;
  if (megabytes > 0) options.memory = megabytes * 1'000'000;
  MakeWorkers workers;
  for (const int card : device.cards.empty() ? std::vector<int>{device.index} : device.cards)
    workers.of_cards.push_back([=] { return make_cuda_backend(card, options); });
  auto first = workers.of_cards[0]();
  return PipelineAccess::make(std::move(first), {Device::cuda, name, "requested"}, std::move(workers));
}

HostBuffer ordinary_buffer(std::size_t count) {
  return {static_cast<Point*>(std::malloc(count * sizeof(Point))), count,
          [](Point* memory) noexcept { std::free(memory); }};
}

void measure(const std::string& device, std::uint64_t megabytes, std::uint64_t count, std::uint64_t stride,
             const Params& params, int repeat, bool is_locked) {
  Pipeline pipeline = over(device, megabytes);
  const auto buffer = [&] { return is_locked ? pipeline.host_buffer(count) : ordinary_buffer(count); };
  const HostBuffer in = buffer(), out = buffer();
  fill(in.points(), stride);
  std::vector<double> times;
  for (int run = 0; run <= repeat; ++run) {
    const auto start = Clock::now();
    pipeline.run(in.points(), params, out.points());
    if (run > 0) times.push_back(std::chrono::duration<double, std::milli>(Clock::now() - start).count());
  }
  std::sort(times.begin(), times.end());
  std::printf("%-12s %-10s median %9.1f ms, least %9.1f ms, %3llu tiles, %016llx ",
              stride == 1 ? "scan lines" : "random", device.c_str(), times[times.size() / 2], times[0],
              static_cast<unsigned long long>(pipeline.report().tiles),
              static_cast<unsigned long long>(hash_of(out.points())));
  for (const StageTime& stage : pipeline.report().stages)
    std::printf(" %s %.1f", stage.name.c_str(), stage.milliseconds);
  std::printf("\n");
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 6) {
    std::fprintf(stderr, "cuda_card_times POINTS K|auto REPEAT MEGABYTES [lines|random] [ordinary] DEVICE...\n");
    return 2;
  }
  const std::uint64_t count = std::strtoull(argv[1], nullptr, 10);
  Params params;
  if (std::string(argv[2]) != "auto") {
    params.k = std::atoi(argv[2]);
    params.iterations = 1;
  }
  constexpr std::uint64_t kPrime = 2'654'435'761;
  std::vector<std::uint64_t> strides{1, kPrime};
  std::vector<std::string> devices;
  bool is_locked = true;
  for (const std::string& word : std::vector<std::string>(argv + 5, argv + argc)) {
    if (word == "lines") {
      strides = {1};
    } else if (word == "random") {
      strides = {kPrime};
    } else if (word == "ordinary") {
      is_locked = false;
    } else {
      devices.push_back(word);
    }
  }
  for (const std::uint64_t stride : strides)
    for (const std::string& device : devices)
      measure(device, std::strtoull(argv[4], nullptr, 10), count, stride, params, std::max(1, std::atoi(argv[3])),
              is_locked);
}
