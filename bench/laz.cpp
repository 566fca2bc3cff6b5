// SPDX-License-Identifier: Apache-2.0
// bench_laz IN [OUT]: seconds, and those of all threads together, to read a file and, with OUT, to write it with every
// point moved; the most memory that was held, mapped files included. One JSON object.
#include <chrono>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <string>

#include "pointfair/pointfair.hpp"

namespace {

struct Seconds {
  double wall = 0, processor = 0;
};

template <class Work>
Seconds seconds_of(const Work& work) {
  const auto start = std::chrono::steady_clock::now();
  const std::clock_t processor = std::clock();
  work();
  return {std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count(),
          static_cast<double>(std::clock() - processor) / CLOCKS_PER_SEC};
}

// Not by getrusage, which remembers the program that started this one.
long peak_bytes() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmHWM:")) return std::stol(line.substr(6)) * 1024;
  }
  return 0;
}

}  // namespace

int main(int count, char** words) {
  if (count < 2) return 2;
  try {
    pointfair::Cloud cloud;
    const Seconds read = seconds_of([&] { cloud = pointfair::read(words[1]); });
    const long peak_of_read = peak_bytes();
    Seconds write;
    if (count > 2) {
      float sign = 0.02F;
      for (pointfair::Point& p : cloud.points) p.z += (sign = -sign);
      pointfair::WriteOptions options;
      options.overwrite = true;
      write = seconds_of([&] { pointfair::write(words[2], cloud, options); });
    }
    std::printf(
        "{\"points\": %zu, \"read\": [%.6f, %.6f], \"write\": [%.6f, %.6f], \"peak_of_read\": %ld, \"peak\": %ld}\n",
        cloud.points.size(), read.wall, read.processor, write.wall, write.processor, peak_of_read, peak_bytes());
  } catch (const pointfair::Error& error) {
    std::fprintf(stderr, "bench_laz: %s\n", error.what());
    return 1;
  }
}
