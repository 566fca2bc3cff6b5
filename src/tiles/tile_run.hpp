// SPDX-License-Identifier: Apache-2.0
// One iteration over a cloud in host memory, tile by tile.
//
// Exact halos. A tile is uploaded with a halo, and its worker tells of each point whether the result would be the same
// with the whole cloud loaded (point/region.h): its neighbourhood lies inside what is loaded, and so do those of all
// whose normals or mean distances it reads. Points of which that is not sure are done again with a halo twice as wide.
// Nothing that a result depends on is a matter of which other points are loaded: ties go by position, large
// neighbourhoods are thinned by position, and sums over them run along a curve that is laid over the whole cloud.
#pragma once

#include <mutex>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "seam/backend.hpp"
#include "tiles/cut.hpp"
#include "tiles/feeders.hpp"
#include "tiles/halo.hpp"
#include "tiles/tiled_backend.hpp"

namespace pointfair {

using Indices = std::vector<std::uint32_t>;

// The same for some of the points, by their indices in the cloud.
FramedSettings settings_for(const FramedSettings& settings, std::span<const std::uint32_t> indices);

// Points whose results are wanted: those of a cell, or those listed.
struct TileTask {
  std::optional<Cell> cell;
  Indices listed;
  Bounds bounds;
  double halo;

  bool wants(std::uint32_t index, const Point& p) const;
};

// A backend, and the task that it is about.
struct TileWorker {
  explicit TileWorker(std::unique_ptr<Backend> its_backend) : backend(std::move(its_backend)) {}

  std::optional<TileTask> task;
  point::Region loaded{};
  Indices indices;  // of the uploaded points
  HostBuffer in, out;
  std::vector<unsigned char> outcomes;
  std::unique_ptr<Backend> backend;  // goes first, since it may still read `in`

  std::span<Point> room(HostBuffer& buffer, std::size_t count);
  // All of `input` that lies in the region.
  void find(const Cut& cut, const point::Region& region, const ForEach& for_each);
  // What was found. Goes on until the backend is asked for a result, or finish_upload().
  void upload(std::span<const Point> input, const ForEach& for_each);
  void finish_upload();
};

class TileRun {
 public:
  TileRun(std::vector<TileWorker>& workers, const Tiling& tiling, ForEach for_each)
      : workers_(workers), tiling_(tiling), for_each_(std::move(for_each)) {}

  struct Results {
    std::span<Point> points, normals;  // of the whole cloud; either may be empty
    Counts counts;
    std::uint64_t peak_host_bytes = 0, peak_device_bytes = 0;  // of the workers
  };
  // Writes the results of all valid points of `input`, which `cut` has cut.
  void run(const Cut& cut, std::span<const Point> input, const FramedSettings& stages, Results& results,
           const std::stop_token& stop);

 private:
  struct Job;
  void feed(Job& job, std::span<TileWorker> workers, const std::stop_token& stop);
  void start(Job& job, TileWorker& worker, TileTask task, const std::stop_token& stop);
  void split(Job& job, const TileWorker& worker, TileTask task);
  void collect(Job& job, TileWorker& worker);
  Indices take_results(Job& job, const TileWorker& worker, const TileTask& task, std::span<const Point> out,
                       std::span<const Point> normals);

  std::vector<TileWorker>& workers_;
  const Tiling& tiling_;
  ForEach for_each_;
};

// The workers of each feeder.
std::span<TileWorker> workers_of(std::vector<TileWorker>& workers, std::size_t feeder, std::size_t feeders);

void add(Counts& counts, const Counts& more);

// Calls body(first, last) for consecutive blocks of `count` numbers, many at once.
void for_tile_blocks(std::size_t count, const ForEach& for_each,
                     const std::function<void(std::size_t, std::size_t)>& body);

}  // namespace pointfair
