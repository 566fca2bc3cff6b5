// SPDX-License-Identifier: Apache-2.0
// What the peer programs share: their command line, a reader for float PLY, threads, timing, one line of JSON.
// Peers are measured beside pointfair and so use nothing of it.
#pragma once

#include <algorithm>
#include <atomic>
#include <bit>
#include <chrono>
#include <cstdint>
#include <exception>
#include <fstream>
#include <functional>
#include <iostream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

namespace peer {

struct Point {
  float x, y, z;
};

struct Arguments {
  std::string in, out;
  int k = 8;
  int repeat = 5;
  unsigned threads = 2;
  bool morton = false;  // points are put in Morton order before the clock starts
};

// What one run gives: the moved points (none for a neighbour search) and, where it can be told, the seconds of each
// part.
struct Outcome {
  std::vector<Point> points;
  std::vector<std::pair<std::string, double>> parts;
};

// A run goes from array to array and is timed whole. Making it is not: that is where a peer gets what it asks for
// beyond points, such as a radius or normals. The points outlive the run.
using Run = std::function<Outcome()>;
using Prepare = std::function<Run(const std::vector<Point>&, const Arguments&)>;

inline constexpr const char* kUsage =
    "IN.ply [--k K] [--repeat R] [--threads T] [--order input|morton] [--out OUT.ply]";

inline Arguments parse_arguments(int argc, char** argv) {
  Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (!word.starts_with("--")) {
      arguments.in = word;
      continue;
    }
    if (i + 1 == argc) throw std::runtime_error(word + ": a value is missing");
    const std::string value = argv[++i];
    if (word == "--k") {
      arguments.k = std::stoi(value);
    } else if (word == "--repeat") {
      arguments.repeat = std::stoi(value);
    } else if (word == "--threads") {
      arguments.threads = static_cast<unsigned>(std::stoul(value));
    } else if (word == "--order" && (value == "input" || value == "morton")) {
      arguments.morton = value == "morton";
    } else if (word == "--out") {
      arguments.out = value;
    } else {
      throw std::runtime_error(word + " " + value + ": unknown; use " + kUsage);
    }
  }
  if (arguments.in.empty() || arguments.k < 1 || arguments.repeat < 1 || arguments.threads < 1) {
    throw std::runtime_error(std::string("use ") + kUsage);
  }
  return arguments;
}

// Reads a binary little-endian PLY whose first element has three float properties x, y, z and nothing else: what
// `pointfair noise` writes.
inline std::vector<Point> read_ply(const std::string& path) {
  static_assert(std::endian::native == std::endian::little);
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error(path + ": cannot be opened");
  std::uint64_t count = 0;
  std::string line, properties;
  bool binary = false;
  while (std::getline(file, line) && line != "end_header") {
    if (line.starts_with("element vertex ")) count = std::stoull(line.substr(15));
    if (line.starts_with("property ")) properties += line.substr(9) + ";";
    if (line == "format binary_little_endian 1.0") binary = true;
  }
  if (!binary || properties != "float x;float y;float z;") {
    throw std::runtime_error(path + ": not a binary little-endian PLY of float x, y, z only");
  }
  std::vector<Point> points(count);
  file.read(reinterpret_cast<char*>(points.data()), static_cast<std::streamsize>(count * sizeof(Point)));
  if (!file) throw std::runtime_error(path + ": ends before its " + std::to_string(count) + " points");
  return points;
}

inline void write_ply(const std::string& path, const std::vector<Point>& points) {
  std::ofstream file(path, std::ios::binary);
  file << "ply\nformat binary_little_endian 1.0\nelement vertex " << points.size()
       << "\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  file.write(reinterpret_cast<const char*>(points.data()), static_cast<std::streamsize>(points.size() * sizeof(Point)));
  if (!file) throw std::runtime_error(path + ": cannot be written");
}

// Puts two zero bits between the lowest 21 bits of `x`.
inline std::uint64_t spread(std::uint64_t x) {
  x &= 0x1fffff;
  x = (x | x << 32) & 0x1f00000000ffff;
  x = (x | x << 16) & 0x1f0000ff0000ff;
  x = (x | x << 8) & 0x100f00f00f00f00f;
  x = (x | x << 4) & 0x10c30c30c30c30c3;
  return (x | x << 2) & 0x1249249249249249;
}

inline std::vector<Point> morton_ordered(const std::vector<Point>& points) {
  if (points.empty()) return {};
  Point low = points.front(), high = low;
  for (const Point& p : points) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
  const float extent = std::max({high.x - low.x, high.y - low.y, high.z - low.z, 1e-30f});
  const auto cell = [&](float offset) { return static_cast<std::uint64_t>(offset / extent * 2097151.0f); };
  std::vector<std::pair<std::uint64_t, std::uint32_t>> order(points.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    const Point& p = points[i];
    order[i] = {spread(cell(p.x - low.x)) | spread(cell(p.y - low.y)) << 1 | spread(cell(p.z - low.z)) << 2, i};
  }
  std::sort(order.begin(), order.end());
  std::vector<Point> sorted(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) sorted[i] = points[order[i].second];
  return sorted;
}

// body(i) for every i below `count`, in blocks that free threads take in turn.
template <class Body>
void parallel_for(std::size_t count, unsigned threads, const Body& body) {
  constexpr std::size_t kBlock = 1024;
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    for (std::size_t begin; (begin = next.fetch_add(kBlock)) < count;) {
      const std::size_t end = std::min(begin + kBlock, count);
      for (std::size_t i = begin; i < end; ++i) body(i);
    }
  };
  std::vector<std::jthread> others;
  for (unsigned t = 1; t < threads; ++t) others.emplace_back(work);
  work();
}

// Seconds since it was made or last asked.
class Stopwatch {
 public:
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    return std::chrono::duration<double>(now - std::exchange(start_, now)).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

inline double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

// A line of /proc/self/status such as VmRSS (resident now) or VmHWM (the most ever), in bytes.
inline std::int64_t own_memory(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with(key + ":")) return std::stoll(line.substr(key.size() + 1)) * 1024;
  }
  return 0;
}

struct Measurement {
  std::vector<double> totals;                                      // seconds of each run
  std::vector<std::pair<std::string, std::vector<double>>> parts;  // and of its parts
  Outcome last;
};

inline Measurement measure(const Run& run, int repeat) {
  Measurement measured;
  for (int r = 0; r < repeat; ++r) {
    measured.last = {};  // freed before the next run, so that the peak of memory is that of one run
    Stopwatch watch;
    measured.last = run();
    measured.totals.push_back(watch.lap());
    measured.parts.resize(measured.last.parts.size());
    for (std::size_t i = 0; i < measured.parts.size(); ++i) {
      measured.parts[i].first = measured.last.parts[i].first;
      measured.parts[i].second.push_back(measured.last.parts[i].second);
    }
  }
  return measured;
}

// The program: reads, prepares, measures, prints one JSON line. Times are medians in seconds; `peak_bytes` is what
// preparation and runs needed on top of the input.
inline int peer_main(int argc, char** argv, const std::string& name, const std::string& library,
                     const Prepare& prepare) try {
  const Arguments arguments = parse_arguments(argc, argv);
  std::vector<Point> points = read_ply(arguments.in);
  if (arguments.morton) points = morton_ordered(points);
  const std::int64_t before = own_memory("VmRSS");
  Stopwatch watch;
  const Run run = prepare(points, arguments);
  const double preparation_seconds = watch.lap();
  const Measurement measured = measure(run, arguments.repeat);

  std::ostringstream line;
  line << "{\"name\":\"" << name << "\",\"library\":\"" << library << "\",\"points\":" << points.size()
       << ",\"k\":" << arguments.k << ",\"threads\":" << arguments.threads << ",\"order\":\""
       << (arguments.morton ? "morton" : "input") << "\",\"repeat\":" << arguments.repeat
       << ",\"seconds\":" << median(measured.totals) << ",\"preparation_seconds\":" << preparation_seconds;
  for (const auto& [part, seconds] : measured.parts) line << ",\"" << part << "_seconds\":" << median(seconds);
  line << ",\"peak_bytes\":" << own_memory("VmHWM") - before << "}";
  std::cout << line.str() << std::endl;
  if (!arguments.out.empty()) {
    if (measured.last.points.empty()) throw std::runtime_error("moves no points: leave out --out");
    write_ply(arguments.out, measured.last.points);
  }
  return 0;
} catch (const std::exception& error) {
  std::cerr << name << ": " << error.what() << '\n';
  return 1;
}

}  // namespace peer
