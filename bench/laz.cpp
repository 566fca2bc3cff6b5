// SPDX-License-Identifier: Apache-2.0
// bench_laz IN [OUT]: seconds to read a file and, with OUT, to write it with every point moved, as one JSON object.
#include <sys/resource.h>

#include <chrono>
#include <cstdio>
#include <filesystem>

#include "pointfair/pointfair.hpp"

namespace {

template <class Work>
double seconds_of(const Work& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

long peak_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss * 1024;
}

}  // namespace

int main(int count, char** words) {
  if (count < 2) return 2;
  try {
    pointfair::Cloud cloud;
    const double read = seconds_of([&] { cloud = pointfair::read(words[1]); });
    const long peak_of_read = peak_bytes();
    double write = 0;
    if (count > 2) {
      float sign = 0.02F;
      for (pointfair::Point& p : cloud.points) p.z += (sign = -sign);
      pointfair::WriteOptions options;
      options.overwrite = true;
      write = seconds_of([&] { pointfair::write(words[2], cloud, options); });
    }
    std::printf("{\"points\": %zu, \"read\": %.6f, \"write\": %.6f, \"peak_of_read\": %ld, \"peak\": %ld}\n",
                cloud.points.size(), read, write, peak_of_read, peak_bytes());
  } catch (const pointfair::Error& error) {
    std::fprintf(stderr, "bench_laz: %s\n", error.what());
    return 1;
  }
}
