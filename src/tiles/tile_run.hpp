// SPDX-License-Identifier: Apache-2.0
// One iteration over the points of a store, tile by tile: what a run in memory and one on disk have in common.
//
// Exact halos. A tile is loaded with a halo, and its worker tells of each point whether the result would be the same
// with the whole cloud loaded (point/region.h): its neighbourhood lies inside what is loaded, and so do those of all
// whose normals or mean distances it reads. Points of which that is not sure are done again with a halo twice as wide.
// Where more is loaded than fits, the wanted points are halved. Nothing that a result depends on is a matter of which
// other points are loaded: ties go by position, large neighbourhoods are thinned by position, and sums over them run
// along a curve that is laid over the whole cloud.
#pragma once

#include <limits>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "point/region.h"
#include "seam/backend.hpp"
#include "seam/cloud_sample.hpp"
#include "tiles/feeders.hpp"
#include "tiles/halo.hpp"

namespace pointfair {

using Indices = std::vector<std::uint32_t>;

inline bool same_place(const Point& a, const Point& b) { return a.x == b.x && a.y == b.y && a.z == b.z; }

// Points whose results are wanted: those of a cell, or those listed.
struct TileTask {
  std::optional<point::Cell> cell;
  Indices listed;   // ascending
  Bounds bounds;    // of them
  double halo = 0;  // around these that is loaded; 0: as first_halo() says, but at most so wide:
  double widest_halo = std::numeric_limits<double>::infinity();
};

// A backend, and what it computes.
struct TileWorker {
  explicit TileWorker(Backend& its_backend) : backend(&its_backend) {}

  // What a store loads.
  Indices numbers;  // of the first of the points; the others only lie around them
  std::span<const Point> points;
  Indices known_copies;  // of these, from the iteration before, ascending; each is where the point is that it follows
  std::span<Point> results;  // room for theirs, which may be where they are
  bool overlaps = false;     // whether the points stay until finish_upload(): stages may begin before all are copied

  // For stores whose points lie elsewhere: as much of a buffer, which is page-locked where the backend is a card.
  std::span<Point> room(HostBuffer& buffer, std::size_t count);
  HostBuffer in, out;

  // The points, without their copies: those that are known, or those that the rule finds.
  void upload(IndexOrder expected, const CopyRule& rule);
  void finish_upload();
  // Keeps the most that the backend took.
  void note_costs();

  Backend* backend;
  std::uint64_t peak_host_bytes = 0, peak_device_bytes = 0;
  std::optional<TileTask> task;  // that it is at
  point::Region loaded{};
  double halo = 0;  // with which it was loaded
  std::vector<unsigned char> outcomes;
  std::vector<Copy> copies;  // among the points
};

// Where the points of a cloud are loaded from, and their results go. Several workers may load, and hand back results of
// different points, at once. Where only neighbourhoods are sampled, no result comes.
class PointStore {
 public:
  virtual ~PointStore() = default;
  virtual const Bounds& bounds() const = 0;  // of the whole cloud
  // All valid points of the region, into the worker. False if they are more than fit; the numbers are told even so.
  virtual bool load(const point::Region& region, TileWorker& worker) = 0;
  // The points nearest to a place, into the worker, as many as fit: of a point that lies far off, its nearest ones fit
  // where a box around it does not. Returns the distance up to which they are all; 0: the store knows no nearest ones.
  virtual double load_nearest(const Point& /*to*/, TileWorker& /*worker*/) { return 0; }
  // That what lies around a point, of which nothing else is wanted, does not fit.
  virtual Error does_not_fit(std::size_t number) const = 0;
  // Those whose results may be wanted, by their numbers.
  virtual std::span<const Point> points() const { return {}; }
  // Keeps those of the results whose outcome is not 0.
  virtual void keep(std::span<const std::uint32_t> /*numbers*/, std::span<const Point> /*results*/,
                    std::span<const unsigned char> /*outcomes*/) {}
};

struct TileRun {
  enum class Result { points, normals };

  PointStore& store;
  const FramedSettings& stages;
  ForEach for_each;
  Result result = Result::points;
  std::size_t feeders = 1;  // threads that hand tiles to workers, each to as many of them
  double first_halo = 1;    // of the width that is thought to suffice
  // Wanted points are halved, too, if the memory does not suffice for so many that are loaded; for fewer, and without
  // such a number, the error is the caller's.
  std::size_t least_split = std::numeric_limits<std::size_t>::max();
};
// Hands the results of all points of `first` to the store. Throws Error(memory) if one does not fit.
Counts run_tiles(const TileRun& run, std::span<TileWorker> workers, std::vector<TileTask> first,
                 const std::stop_token& stop);

// The settings for some of the points, by their indices in the cloud.
FramedSettings settings_for(const FramedSettings& settings, std::span<const std::uint32_t> indices);

// The workers of each feeder.
std::span<TileWorker> workers_of(std::span<TileWorker> workers, std::size_t feeder, std::size_t feeders);

void add(Counts& counts, const Counts& more);

// Calls body(first, last) for consecutive blocks of `count` numbers, many at once.
void for_tile_blocks(std::size_t count, const ForEach& for_each,
                     const std::function<void(std::size_t, std::size_t)>& body);

}  // namespace pointfair
