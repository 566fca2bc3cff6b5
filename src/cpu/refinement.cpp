// SPDX-License-Identifier: Apache-2.0
#include "cpu/refinement.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "cpu/index.h"
#include "cpu/parallel.h"
#include "point/neighbors.h"

namespace pointfair::cpu {
namespace {

namespace net = point::net;

constexpr std::size_t kLeavesABlock = 64, kPointsABlock = kLeavesABlock * kLeafSize;
constexpr int kNowhere = -1;
constexpr int kSteps = 1 + net::kScales + 2 + net::kLayers;  // the index, each list, slide, begin, each layer

point::Vec3<float> vector_of(const Point& p) { return {p.x, p.y, p.z}; }

// Every 4^s-th point, by a hash of positions, and where each point of the cloud lies among them.
struct Coarse {
  explicit Coarse(MemoryMeter& meter) : index(meter) {}
  SpatialIndex index;
  std::vector<int> own;          // of each sorted point of the cloud
  std::vector<Index> leaf_near;  // of each leaf of the cloud
};

class Net {
 public:
  Net(const Classical& classical, const NetWeights& weights, const Frame& frame, const Kernels& kernels,
      const NetKernels& net_kernels, const std::stop_token& stop, const NetProgress& progress)
      : classical_(classical),
        weights_(weights.view()),
        frame_(frame),
        stop_(stop),
        kernels_(kernels),
        net_kernels_(net_kernels),
        progress_(progress) {
    index_.build(classical.points, {}, frame, space_, kernels_, stop);
    end_step();
  }

  void run(std::span<Point> out) {
    const IndexView cloud = index_.view();
    if (cloud.points <= net::kNeighbors) return;
    find_neighbors();
    run_layers();
    for_items(cloud.points, kPointsABlock, stop_, [&](std::size_t i) {
      const Index at = cloud.original[i];
      const net::Place& here = places_[i];
      if (!net::can_move(here) || classical_.held[at] != 0) return;
      const point::Vec3<float> moved = point::Vec3<float>{cloud.x[i], cloud.y[i], cloud.z[i]} + here.noise * steps_[i];
      if (point::is_indexable(moved)) out[at] = {moved.x, moved.y, moved.z};
    });
  }

 private:
  void find_neighbors() {
    const IndexView cloud = index_.view();
    const std::size_t room = std::size_t(cloud.leaves) * kLeafSize * net::kNeighbors;
    for (int s = 0; s < net::kScales; ++s) {
      if (s > 0 && !choose(s)) {  // too few points: as the finer scale
        lists_of_[s] = lists_of_[s - 1];
        end_step();
        continue;
      }
      lists_[s].resize(room);
      lists_of_[s] = lists_[s].data();
      for_items(cloud.leaves, kLeavesABlock, stop_, [&](std::size_t leaf) { find_neighbors_of(Index(leaf), s); });
      end_step();
    }
  }

  // Rows of the cloud's sorted positions.
  void find_neighbors_of(Index leaf, int scale) {
    const IndexView cloud = index_.view(), there = scale == 0 ? cloud : coarse_.index.view();
    Index found[net::kNeighbors * kLeafSize];
    if (scale == 0) {
      kernels_.nearest(cloud, leaf, net::kNeighbors, __builtin_inff(), found);
    } else {
      kernels_.nearest_there(cloud, leaf, there, coarse_.own.data() + std::size_t(leaf) * kLeafSize,
                             coarse_.leaf_near[leaf], net::kNeighbors, found);
    }
    const Index points = std::min<Index>(kLeafSize, cloud.points - leaf * kLeafSize);
    for (Index lane = 0; lane < points; ++lane) {
      Index* row = lists_[scale].data() + (std::size_t(leaf) * kLeafSize + lane) * net::kNeighbors;
      for (int slot = 0; slot < net::kNeighbors; ++slot) {
        const Index at = found[slot * kLeafSize + int(lane)];
        row[slot] = scale == 0 ? at : there.original[at];
      }
    }
  }

  // False where they are too few for every point to have its neighbours among them.
  bool choose(int scale) {
    const IndexView cloud = index_.view();
    const float share = 1.0f / float(1 << 2 * scale);
    std::vector<Index> members;
    coarse_.leaf_near.resize(cloud.leaves);
    for (Index i = 0; i < cloud.points; ++i) {
      if (i % kLeafSize == 0) coarse_.leaf_near[i / kLeafSize] = Index(members.size()) / kLeafSize;
      if (cloud.share[i] < share) members.push_back(i);
    }
    if (members.size() <= net::kNeighbors) return false;
    std::vector<Point> points(members.size());
    std::ranges::transform(members, points.begin(), [&](Index i) { return Point{cloud.x[i], cloud.y[i], cloud.z[i]}; });
    coarse_.index.build(points, members, frame_, space_, kernels_, stop_);
    const IndexView there = coarse_.index.view();
    coarse_.own.assign(std::size_t(cloud.leaves) * kLeafSize, kNowhere);
    for (Index c = 0; c < there.points; ++c) coarse_.own[there.original[c]] = int(c);
    for (Index& leaf : coarse_.leaf_near) leaf = std::min(leaf, there.leaves - 1);
    return true;
  }

  void run_layers() {
    const IndexView cloud = index_.view();
    const std::size_t points = cloud.points, numbers = points * net::kChannels;
    places_.resize(points);
    turned_.resize(points);
    for (Buffer<float>& sizes : sizes_) sizes.resize(points);
    for (Buffer<point::Vec3<float>>* vectors : {&sides_, &steps_}) vectors->resize(points + 1);  // as net_slide() reads
    states_.resize(numbers);
    stored_.resize(numbers);
    for_points([&](Index first, Index last) {
      for (Index i = first; i < last; ++i) {
        const Index at = cloud.original[i];
        places_[i] = {{cloud.x[i], cloud.y[i], cloud.z[i]},
                      vector_of(classical_.normals[at]),
                      vector_of(classical_.measured[at]),
                      classical_.noise[at]};
      }
    });
    unite_places();
    slide();
    end_step();
    const NetCloud view{{lists_of_[0], lists_of_[1], lists_of_[2], lists_of_[3]},
                        places_.data(),
                        turned_.data(),
                        sides_.data(),
                        {sizes_[0].data(), sizes_[1].data(), sizes_[2].data(), sizes_[3].data()},
                        states_.data(),
                        stored_.data(),
                        steps_.data()};
    for_points([&](Index first, Index last) { net_kernels_.begin(view, weights_, first, last); });
    for_points([&](Index first, Index last) {
      for (Index i = first; i < last; ++i) {
        point::Vec3<float>& normal = places_[i].normal;
        if (turned_[i] != 0) normal = {-normal.x, -normal.y, -normal.z};
      }
    });
    end_step();
    for (int layer = 0; layer < net::kLayers; ++layer) {
      for_points([&](Index first, Index last) { net_kernels_.store(view, weights_, layer, first, last); });
      for_points([&](Index first, Index last) { net_kernels_.layer(view, weights_, layer, first, last); });
      end_step();
    }
  }

  // Points that the stages brought to one place lie side by side in the order of the input: all are to the net what
  // the one is that was measured first in the order of positions.
  void unite_places() {
    net::Place* const end = places_.data() + index_.view().points;
    for (net::Place *one = places_.data(), *next = one; one != end; one = next) {
      net::Place first = *one;
      const point::Vec3<float> here = one->classical;
      for (; next != end && next->classical.x == here.x && next->classical.y == here.y && next->classical.z == here.z;
           ++next)
        if (point::lies_before(next->measured, first.measured)) first = *next;
      for (; one != next; ++one) *one = {one->classical, first.normal, first.measured, first.noise};
    }
  }

  // Moves what the net reads as the classical places, and begins the steps with that.
  void slide() {
    for_points([&](Index first, Index last) {
      for (Index i = first; i < last; ++i) steps_[i] = places_[i].classical;
    });
    point::Vec3<float>*from = steps_.data(), *to = sides_.data();
    for (int round = 0; round < net::kSlides; ++round) {
      const NetSlide slide{places_.data(), lists_of_[0], from, to};
      for_points([&](Index first, Index last) { net_kernels_.slide(slide, first, last); });
      std::swap(from, to);
    }
    for_points([&](Index first, Index last) {
      for (Index i = first; i < last; ++i) {
        net::Place& here = places_[i];
        const point::Vec3<float> slid = from[i], way = slid - here.classical;
        steps_[i] = net::can_move(here) ? net::in_noises(here, way) : point::Vec3<float>{};
        here.classical = slid;
      }
    });
  }

  void end_step() {
    if (progress_) progress_(double(++steps_done_) / kSteps);
  }

  template <class Body>
  void for_points(const Body& body) {
    for_blocks(index_.view().points, kPointsABlock, stop_,
               [&](std::size_t first, std::size_t last, std::size_t) { body(Index(first), Index(last)); });
  }

  const Classical& classical_;
  const net::Weights& weights_;
  const Frame& frame_;
  const std::stop_token& stop_;
  const Kernels& kernels_;
  const NetKernels& net_kernels_;
  const NetProgress& progress_;
  int steps_done_ = 0;
  MemoryMeter meter_;
  SortSpace space_{meter_};
  SpatialIndex index_{meter_};
  Coarse coarse_{meter_};
  std::array<Buffer<Index>, net::kScales> lists_{Buffer<Index>(meter_), Buffer<Index>(meter_), Buffer<Index>(meter_),
                                                 Buffer<Index>(meter_)};
  std::array<const Index*, net::kScales> lists_of_{};
  Buffer<net::Place> places_{meter_};
  Buffer<point::Vec3<float>> sides_{meter_}, steps_{meter_};
  std::array<Buffer<float>, net::kScales> sizes_{Buffer<float>(meter_), Buffer<float>(meter_), Buffer<float>(meter_),
                                                 Buffer<float>(meter_)};
  Buffer<std::uint8_t> turned_{meter_}, states_{meter_};
  Buffer<std::int16_t> stored_{meter_};
};

}  // namespace

void refine(const Classical& classical, const NetWeights& weights, const Frame& frame, const Kernels& kernels,
            const NetKernels& net_kernels, std::span<Point> out, const std::stop_token& stop,
            const NetProgress& progress) {
  Net net(classical, weights, frame, kernels, net_kernels, stop, progress);
  if (out.data() != classical.points.data()) std::ranges::copy(classical.points, out.begin());
  net.run(out);
}

}  // namespace pointfair::cpu

namespace pointfair {

void refine(const Classical& classical, const NetWeights& weights, const Frame& frame, std::span<Point> out,
            const std::stop_token& stop, const NetProgress& progress) {
  cpu::refine(classical, weights, frame, cpu::best_kernels(), cpu::best_net_kernels(), out, stop, progress);
}

}  // namespace pointfair
