// SPDX-License-Identifier: Apache-2.0
// Times each stage of the CUDA backend on clouds that hurt: uneven density, identical points, a stray point.
//   cuda_stage_times [POINTS] [REPEAT] [host]
//   cuda_stage_times [POINTS] [REPEAT] cancel
//   cuda_stage_times FILE [REPEAT]
// The same for the default run of a cloud, all automatic, through the pipeline: each stage over both iterations; then
// what automatic parameters add, resident, to the same run with these parameters typed in, taken in turns with it.
//
// A line a cloud and k: medians in milliseconds, points resident on the card; each stage timed from an idle card to an
// idle card, and `whole` with all stages in flight at once. The checksum is the sum of all faired coordinates.
// With `host`: from a page-locked array of the host to another, through the public Pipeline, in random and in spatial
// order, by load and run and by both at once, and cut into 4 pieces; `whole` is the median of load and run together,
// the rest its report's medians.
// With `cancel`: how long runs over radii of 19 spacings go on when they are stopped at a random moment, median and
// worst of REPEAT.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <map>
#include <numeric>
#include <thread>

#include "pipeline/pipeline_access.hpp"
#include "pointfair/pointfair.hpp"
#include "seam/backend.hpp"
#include "shapes.h"
#include "tiles/tiled_backend.hpp"

namespace {

using namespace pointfair;
using Points = std::vector<Point>;
using Clock = std::chrono::steady_clock;

template <class Body>
void in_parallel(std::size_t count, Body body) {
  std::vector<std::thread> threads;
  const std::size_t parts = std::max(1u, std::thread::hardware_concurrency());
  for (std::size_t part = 0; part < parts; ++part)
    threads.emplace_back([=] { body(part, count * part / parts, count * (part + 1) / parts); });
  for (std::thread& thread : threads) thread.join();
}

// A bumpy sphere of diameter about 1 in random order, noise along the normal. `ratio`: density at one end of the z axis
// over that at the other.
Points bumpy_ball(std::size_t count, double noise, double ratio) {
  Points points(count);
  in_parallel(count, [&](std::size_t part, std::size_t first, std::size_t last) {
    shapes::Random random(part + 17);
    for (std::size_t i = first; i < last; ++i) {
      double x = 0, y = 0, z = 0, length = 0;
      do {
        x = random.uniform(-1, 1), y = random.uniform(-1, 1), z = random.uniform(-1, 1);
        length = std::sqrt(x * x + y * y + z * z);
      } while (length < 0.1 || length > 1 || random.uniform() > std::pow(ratio, (z / length - 1) / 2));
      x /= length, y /= length, z /= length;
      const double r =
          0.3 * (1 + 0.1 * std::sin(8 * x) * std::sin(7 * y + 1) * std::cos(9 * z) + 0.03 * std::sin(30 * x + 20 * y)) +
          noise * random.normal();
      points[i] = shapes::make_point(r * x, r * y, r * z);
    }
  });
  return points;
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

double milliseconds(Backend& backend, const std::function<void()>& body) {
  const auto start = Clock::now();
  body();
  backend.counts(0);  // waits for the card
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

struct Case {
  std::string name;
  int k;
  bool constraint = false;
  AreaWeight area = AreaWeight::none;
};

void measure(Backend& backend, const Points& points, const Case& c, int repeat) {
  const double spacing = std::sqrt(1.2 / double(points.size()));
  const NeighborSettings neighbors{c.k, 0, c.constraint, float(2.5 * spacing)};
  const NormalSettings normals{{float(2 * spacing)}};
  const FairingSettings fairing{{float(2 * spacing), float(spacing)}, Method::bilateral, c.area};
  const auto upload_start = Clock::now();
  backend.upload(points, IndexOrder::fastest);
  const double upload = std::chrono::duration<double, std::milli>(Clock::now() - upload_start).count();
  std::vector<double> times[6];
  for (int n = 0; n < repeat + 2; ++n) {
    const double wait = milliseconds(backend, [] {});
    const double t[] = {milliseconds(backend, [&] { backend.build_index(0, {}, {}); }),
                        milliseconds(backend, [&] { backend.find_neighbors(0, neighbors, {}); }),
                        milliseconds(backend, [&] { backend.estimate_normals(0, normals, {}); }),
                        milliseconds(backend, [&] { backend.fair(0, fairing, {}); }), milliseconds(backend, [&] {
                          backend.build_index(0, {}, {});
                          backend.find_neighbors(0, neighbors, {});
                          backend.estimate_normals(0, normals, {});
                          backend.fair(0, fairing, {});
                        })};
    for (int i = 0; i < 5 && n >= 2; ++i) times[i].push_back(t[i] - wait);
    if (n >= 2) times[5].push_back(wait);
  }
  Points out(points.size());
  backend.download(0, out, {}, {});
  double checksum = 0;
  for (const Point& p : out) checksum += double(p.x) + double(p.y) + double(p.z);
  std::printf("%-28s %9zu %3d  %8.3f %8.3f %8.3f %8.3f  %8.3f  (wait %.3f, upload %.1f)  %.1f B/pt  %.9g\n",
              c.name.c_str(), points.size(), c.k, median(times[0]), median(times[1]), median(times[2]),
              median(times[3]), median(times[4]), median(times[5]), upload,
              double(backend.take_costs().peak_device_bytes) / double(points.size()), checksum);
  std::fflush(stdout);
}

// Cell after cell of a grid of 128 a side, the cells in Morton order.
Points in_spatial_order(const Points& points) {
  const auto cell = [](Point p) {
    std::uint32_t key = 0;
    const float v[3] = {p.x, p.y, p.z};
    for (int axis = 0; axis < 3; ++axis) {
      const auto step = std::uint32_t(std::clamp((double(v[axis]) + 0.6) / 1.2 * 128, 0.0, 127.0));
      for (int bit = 0; bit < 7; ++bit) key |= (step >> bit & 1u) << (3 * bit + axis);
    }
    return key;
  };
  std::vector<std::size_t> start((1u << 21) + 1, 0);
  for (const Point& p : points) ++start[cell(p) + 1];
  for (std::size_t i = 1; i < start.size(); ++i) start[i] += start[i - 1];
  Points ordered(points.size());
  for (const Point& p : points) ordered[start[cell(p)]++] = p;
  return ordered;
}

enum class Calls { two, one };  // load and run, or both at once

void measure_from_host(Pipeline& pipeline, const Points& points, const char* name, int k, int repeat,
                       Calls calls = Calls::two) {
  const double spacing = std::sqrt(1.2 / double(points.size()));
  Params params{.k = k};
  params.normal_sigma = params.closeness_sigma = 2 * spacing;
  params.similarity_sigma = spacing;
  params.iterations = 1;
  params.relaxation = 1;
  const HostBuffer in = pipeline.host_buffer(points.size()), out = pipeline.host_buffer(points.size());
  std::copy(points.begin(), points.end(), in.points().begin());
  std::vector<double> wholes;
  std::vector<std::vector<double>> stages;
  std::vector<std::string> names;
  for (int n = 0; n < repeat + 2; ++n) {
    const auto start = Clock::now();
    if (calls == Calls::one) {
      pipeline.run(in.points(), params, out.points());
    } else {
      pipeline.load(in.points());
      pipeline.run(params, out.points());
    }
    const double whole = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
    if (n < 2) continue;
    wholes.push_back(whole);
    const std::vector<StageTime>& report = pipeline.report().stages;
    stages.resize(report.size());
    names.resize(report.size());
    for (std::size_t s = 0; s < report.size(); ++s) {
      names[s] = report[s].name;
      stages[s].push_back(report[s].milliseconds);
    }
  }
  double checksum = 0;
  for (const Point& p : out.points()) checksum += double(p.x) + double(p.y) + double(p.z);
  std::printf("%-26s %9zu %3d  whole %8.3f ", name, points.size(), k, median(wholes));
  for (std::size_t s = 0; s < stages.size(); ++s) std::printf(" %s %.3f", names[s].c_str(), median(stages[s]));
  std::printf("  %.1f B/pt  %.9g\n", double(pipeline.report().peak_device_bytes) / double(points.size()), checksum);
  std::fflush(stdout);
}

// Noise of about half a spacing at 1M, less than a spacing at 10M and 100M.
constexpr std::size_t kMany = 50'000'000;
double noise_of(std::size_t count) { return count > kMany ? 0.00008 : count > 5'000'000 ? 0.0002 : 0.0005; }
constexpr double kWideNoise = 0.0002;  // 1.8 spacings of 100M: the points fill a volume

int measure_host_rows(std::size_t count, int repeat) {
  Pipeline pipeline(Device::cuda);
  if (count > kMany)
    measure_from_host(pipeline, bumpy_ball(count, kWideNoise, 1), "host, random, noise .0002", 8, repeat);
  const Points points = bumpy_ball(count, noise_of(count), 1);
  measure_from_host(pipeline, points, "host, random order", 8, repeat);
  measure_from_host(pipeline, points, "the same, one call", 8, repeat, Calls::one);
  const Points ordered = in_spatial_order(points);
  measure_from_host(pipeline, ordered, "host, spatial order", 8, repeat);
  measure_from_host(pipeline, ordered, "the same, one call", 8, repeat, Calls::one);
  std::vector<std::unique_ptr<Backend>> workers;
  for (int i = 0; i < 2; ++i) workers.push_back(make_cuda_backend(0));
  pipeline = PipelineAccess::make(make_tiled_backend(std::move(workers), {4}), {Device::cuda, "", ""});
  measure_from_host(pipeline, points, "host, random, 4 tiles", 8, repeat);
  measure_from_host(pipeline, ordered, "host, spatial, 4 tiles", 8, repeat);
  return 0;
}

int measure_cancels(std::size_t count, int repeat) {
  Pipeline pipeline(Device::cuda);
  const Points points = bumpy_ball(count, noise_of(count), 1);
  Points out(count);
  pipeline.load(points);
  shapes::Random random(5);
  Params params;
  std::vector<double> times;
  double whole = 0;
  int stopped = 0;
  for (int n = 0; n <= repeat; ++n) {
    params.radius = (19 + 0.01 * n) * std::sqrt(1.2 / double(count));  // so that no result of before serves
    std::stop_source stop;
    std::thread runner([&] {
      try {
        pipeline.run(params, out, stop.get_token());
      } catch (const Error&) {
        ++stopped;
      }
    });
    const auto start = Clock::now();
    if (n > 0) std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(random.uniform(0, whole)));
    const auto asked = Clock::now();
    if (n > 0) stop.request_stop();
    runner.join();
    if (n == 0) whole = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
    if (n > 0) times.push_back(std::chrono::duration<double, std::milli>(Clock::now() - asked).count());
  }
  std::printf("cancel %zu points: a run takes %.0f ms; %d of %d stopped, after %.1f ms, worst %.1f\n", count, whole,
              stopped, repeat, median(times), *std::max_element(times.begin(), times.end()));
  return 0;
}

double resident(const Report& report) {
  double sum = 0;
  for (const StageTime& stage : report.stages)
    if (stage.name != "upload" && stage.name != "download") sum += stage.milliseconds;
  return sum;
}

void measure_default_run(const Points& points, int repeat) {
  Pipeline pipeline(Device::cuda);
  Points out(points.size());
  std::map<std::string, std::vector<double>> times;
  for (int n = 0; n < repeat + 2; ++n) {
    pipeline.load(points);
    pipeline.run({}, out);
    if (n < 2) continue;
    for (const StageTime& stage : pipeline.report().stages) times[stage.name].push_back(stage.milliseconds);
    times["resident"].push_back(resident(pipeline.report()));
  }
  for (const auto& [name, values] : times) std::printf("%-10s %8.3f\n", name.c_str(), median(values));
  const Params chosen = pipeline.report().params;
  std::vector<double> automatic, typed, stoppable;
  const std::stop_source never;
  const auto time = [&](const Params& params, const std::stop_token& stop, std::vector<double>& to) {
    pipeline.load(points);
    pipeline.run(params, out, stop);
    to.push_back(resident(pipeline.report()));
  };
  for (int n = 0; n < repeat + 2; ++n) {
    if (n == 2) automatic.clear(), typed.clear(), stoppable.clear();
    time({}, {}, automatic);
    time(chosen, {}, typed);
    time({}, never.get_token(), stoppable);
  }
  std::printf("automatic  %8.3f, typed in %.3f: %+.1f %%; with a stop token, as programs run, %.3f\n",
              median(automatic), median(typed), 100 * (median(automatic) / median(typed) - 1), median(stoppable));
  std::printf("%.1f B/pt, checksum %.9g\n", double(pipeline.report().peak_device_bytes) / double(points.size()),
              std::accumulate(out.begin(), out.end(), 0.0, [](double sum, Point p) { return sum + p.x + p.y + p.z; }));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 1 && std::strtoull(argv[1], nullptr, 10) == 0) {
    measure_default_run(read(argv[1]).points, argc > 2 ? std::atoi(argv[2]) : 9);
    return 0;
  }
  const std::size_t count = argc > 1 ? std::strtoull(argv[1], nullptr, 10) : 1000000;
  const int repeat = argc > 2 ? std::atoi(argv[2]) : 15;
  const double noise = noise_of(count);
  if (argc > 3 && std::string(argv[3]) == "host") return measure_host_rows(count, repeat);
  if (argc > 3 && std::string(argv[3]) == "cancel") return measure_cancels(count, repeat);
  std::printf("%-28s %9s %3s  %8s %8s %8s %8s  %8s\n", "cloud", "points", "k", "index", "neighb.", "normals", "fairing",
              "whole");
  try {
    const auto fresh = [] { return make_cuda_backend(0); };
    Points even = bumpy_ball(count, noise, 1);
    auto backend = fresh();
    for (const int k : {8, 16, 32}) measure(*backend, even, {"even", k}, repeat);
    measure(*backend, even, {"even, constrained, squared", 8, true, AreaWeight::squared}, repeat);
    if (count > kMany) {
      even = {};
      measure(*backend, bumpy_ball(count, kWideNoise, 1), {"even, noise .0002", 8}, repeat);
      return 0;
    }
    Points stray = even;
    stray[count / 3] = {1e6f, 1e6f, -1e6f};
    measure(*backend, stray, {"one stray point", 8}, repeat);
    Points identical = even;
    for (std::size_t i = 0; i < count / 5; ++i) identical[5 * i] = {0.2f, 0.1f, 0.05f};
    measure(*backend, identical, {"a fifth identical", 8}, repeat);
    Points quantised = even;
    const float grid = float(std::round(1 / (0.5 * std::sqrt(1.2 / double(count)))));
    for (Point& p : quantised)
      p = {std::round(p.x * grid) / grid, std::round(p.y * grid) / grid, std::round(p.z * grid) / grid};
    measure(*backend, quantised, {"quantised to half a spacing", 8}, repeat);
    measure(*backend, bumpy_ball(count, noise, 50), {"uneven 50:1", 8}, repeat);
    measure(*backend, bumpy_ball(count, noise / 4, 1000), {"uneven 1000:1", 8}, repeat);
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
