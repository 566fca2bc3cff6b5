// SPDX-License-Identifier: Apache-2.0
#include <cuda_runtime.h>

#include <algorithm>
#include <climits>
#include <cmath>
#include <stdexcept>
#include <string>

#include "paper/baselines.hpp"
#include "paper/brute_force.cuh"
#include "paper/dense_grid.cuh"
#include "paper/two_kernels.cuh"
#include "point/fairing.h"
#include "point/normal.h"

namespace paper {
namespace {

namespace point = pointfair::point;
using pointfair::Point;

constexpr int kBlock = 128;

void check(cudaError_t status) {
  if (status != cudaSuccess) throw std::runtime_error(std::string("CUDA: ") + cudaGetErrorString(status));
}

unsigned blocks_for(std::size_t count, std::size_t block = kBlock) {
  return static_cast<unsigned>((count + block - 1) / block);
}

// Device memory that grows and stays.
template <class T>
class Array {
 public:
  Array() = default;
  ~Array() { cudaFree(data_); }
  Array(const Array&) = delete;
  Array& operator=(const Array&) = delete;
  T* resized(std::size_t count) {
    if (count > capacity_) {
      check(cudaFree(data_));
      data_ = nullptr;
      capacity_ = 0;
      check(cudaMalloc(&data_, count * sizeof(T)));
      capacity_ = count;
    }
    return data_;
  }
  T* data() const { return data_; }

 private:
  T* data_ = nullptr;
  std::size_t capacity_ = 0;
};

// As integers of the same order, for integer atomics.
__host__ __device__ int ordered(int float_bits) { return float_bits ^ ((float_bits >> 31) & INT_MAX); }

struct Bounds {
  int min[3] = {INT_MAX, INT_MAX, INT_MAX}, max[3] = {INT_MIN, INT_MIN, INT_MIN};  // ordered() bits of floats
};

__global__ void measure_bounds(const float3* points, std::size_t count, Bounds* bounds) {
  Bounds mine;
  const std::size_t stride = std::size_t(gridDim.x) * blockDim.x;
  for (std::size_t i = std::size_t(blockIdx.x) * blockDim.x + threadIdx.x; i < count; i += stride) {
    const float3 p = points[i];
    const int v[3] = {ordered(__float_as_int(p.x)), ordered(__float_as_int(p.y)), ordered(__float_as_int(p.z))};
    for (int axis = 0; axis < 3; ++axis) {
      mine.min[axis] = min(mine.min[axis], v[axis]);
      mine.max[axis] = max(mine.max[axis], v[axis]);
    }
  }
  for (int axis = 0; axis < 3; ++axis) {
    for (int step = 16; step > 0; step /= 2) {
      mine.min[axis] = min(mine.min[axis], __shfl_xor_sync(~0u, mine.min[axis], step));
      mine.max[axis] = max(mine.max[axis], __shfl_xor_sync(~0u, mine.max[axis], step));
    }
    if (threadIdx.x % 32 == 0) {
      atomicMin(&bounds->min[axis], mine.min[axis]);
      atomicMax(&bounds->max[axis], mine.max[axis]);
    }
  }
}

struct Lists {
  const Index* list;  // list[slot * count + query]
  std::size_t count;
  int k;

  template <class Visit>
  __device__ void for_each(const float3* points, std::size_t query, Visit visit) const {
    const float3 v = points[query];
    for (int slot = 0; slot < k; ++slot) {
      const Index neighbor = list[slot * count + query];
      const float3 p = points[neighbor];
      visit(Vec{p.x, p.y, p.z} - Vec{v.x, v.y, v.z}, neighbor);
    }
  }
};

// Eq. 3 to 5, and the mean distance to the five nearest, whose square is W_a.
__global__ void estimate_normals(const float3* points, Lists lists, point::NormalWeights weights, float3* normals,
                                 float* mean_distances) {
  const std::size_t i = std::size_t(blockIdx.x) * blockDim.x + threadIdx.x;
  if (i >= lists.count) return;
  point::CentroidSum<float> centroid_sum;
  float sum = 0;
  int found = 0;
  lists.for_each(points, i, [&](Vec offset, Index) {
    centroid_sum.add(offset, true, weights);
    if (found < point::kAreaNeighbors) {
      sum += point::square_root(point::squared_length(offset));
      ++found;
    }
  });
  const Vec centroid = centroid_sum.centroid();
  point::CovarianceSum<float> covariance;
  lists.for_each(points, i, [&](Vec offset, Index) { covariance.add(offset, centroid, true, weights); });
  const Vec normal = covariance.normal().unit;
  normals[i] = {normal.x, normal.y, normal.z};
  mean_distances[i] = point::mean_distance(sum, static_cast<float>(found));
}

// Eq. 1 and 6.
__global__ void fair(const float3* points, Lists lists, const float3* normals, const float* mean_distances,
                     point::BilateralWeights weights, float3* out) {
  const std::size_t i = std::size_t(blockIdx.x) * blockDim.x + threadIdx.x;
  if (i >= lists.count) return;
  const Vec normal = {normals[i].x, normals[i].y, normals[i].z};
  point::BilateralSum<float> sum;
  lists.for_each(points, i, [&](Vec offset, Index neighbor) {
    const float length = mean_distances[neighbor];
    sum.add(offset, normal, length * length, true, weights);
  });
  const Vec moved = point::moved(Vec{points[i].x, points[i].y, points[i].z}, normal, sum.distance());
  out[i] = {moved.x, moved.y, moved.z};
}

// Cubes, so many along the longest side.
Grid lay_out(const float (&min)[3], const float (&max)[3], int resolution) {
  Grid grid{};
  float longest = 0, largest = 0;
  for (int axis = 0; axis < 3; ++axis) {
    grid.origin[axis] = min[axis];
    longest = std::max(longest, max[axis] - min[axis]);
    largest = std::max({largest, std::abs(min[axis]), std::abs(max[axis])});
  }
  grid.cell = longest > 0 ? longest / static_cast<float>(resolution) : 1.0f;
  grid.slack = 1e-6f * (largest + longest);
  for (int axis = 0; axis < 3; ++axis)
    grid.cells[axis] = std::clamp(static_cast<int>((max[axis] - min[axis]) / grid.cell) + 1, 1, resolution);
  return grid;
}

template <class Launch>
void with_length(int k, Launch launch) {
  if (k == 8) return launch.template operator()<8>();
  if (k == 16) return launch.template operator()<16>();
  if (k == 24) return launch.template operator()<24>();
  if (k == 32) return launch.template operator()<32>();
  throw std::runtime_error("the baselines have lists of 8, 16, 24 and 32 only");
}

}  // namespace

struct CudaBaseline::State {
  enum Mark { start, uploaded, indexed, searched, normals_done, faired, downloaded, marks };

  Array<float3> points, normals, moved;
  Array<float> mean_distances, distances;
  Array<Index> lists;
  Array<int> head, link;
  Array<Bounds> bounds;
  cudaEvent_t events[marks] = {};
  std::size_t count = 0;
  int k = 0;
  StageTimes times;

  State() {
    for (cudaEvent_t& event : events) check(cudaEventCreate(&event));
  }
  ~State() {
    for (cudaEvent_t event : events) cudaEventDestroy(event);
  }

  void mark(Mark which) {
    check(cudaGetLastError());
    check(cudaEventRecord(events[which]));
  }
  float between(Mark first, Mark last) const {
    float milliseconds = 0;
    check(cudaEventElapsedTime(&milliseconds, events[first], events[last]));
    return milliseconds;
  }

  Grid build_index(int resolution) {
    const Bounds nothing;
    Bounds found;
    check(cudaMemcpyAsync(bounds.resized(1), &nothing, sizeof nothing, cudaMemcpyHostToDevice));
    measure_bounds<<<512, kBlock>>>(points.data(), count, bounds.data());
    check(cudaMemcpy(&found, bounds.data(), sizeof found, cudaMemcpyDeviceToHost));
    float min[3], max[3];
    for (int axis = 0; axis < 3; ++axis) {
      min[axis] = __builtin_bit_cast(float, ordered(found.min[axis]));
      max[axis] = __builtin_bit_cast(float, ordered(found.max[axis]));
    }
    Grid grid = lay_out(min, max, resolution);
    grid.head = head.resized(grid.size());
    grid.link = link.resized(count);
    static_assert(kNobody == -1);
    check(cudaMemsetAsync(grid.head, 0xff, grid.size() * sizeof(int)));
    build_grid<<<blocks_for(count), kBlock>>>(points.data(), static_cast<int>(count), grid);
    return grid;
  }

  void search(const Settings& settings, const Grid& grid) {
    lists.resized(count * settings.k);
    with_length(settings.k, [&]<int kLength> {
      if (settings.search == Search::brute_force) {
        search_all_pairs<kLength><<<blocks_for(count, kTile), kTile>>>(points.data(), count, lists.data());
      } else if (settings.search == Search::two_kernels) {
        search_in_turns<kLength>();
      } else {
        search_grid<kLength><<<blocks_for(count), kBlock>>>(points.data(), static_cast<int>(count), grid, lists.data());
      }
    });
  }

  template <int kLength>
  void search_in_turns() {
    std::size_t free = 0, total = 0;
    check(cudaMemGetInfo(&free, &total));
    const std::size_t most = queries_at_a_time(count, total);
    distances.resized(most * count);
    for (std::size_t first = 0; first < count; first += most) {
      const auto queries = static_cast<unsigned>(std::min(most, count - first));
      compute_distances<<<dim3(blocks_for(count, kSharers), queries), kSharers>>>(points.data(), count, first,
                                                                                  distances.data());
      select_nearest<kLength><<<queries, kSharers>>>(points.data(), count, first, distances.data(), lists.data());
    }
  }

  void move_points(const Settings& settings) {
    const Lists found = {lists.data(), count, settings.k};
    estimate_normals<<<blocks_for(count), kBlock>>>(points.data(), found, point::normal_weights(settings.normal_sigma),
                                                    normals.resized(count), mean_distances.resized(count));
    mark(normals_done);
    fair<<<blocks_for(count), kBlock>>>(points.data(), found, normals.data(), mean_distances.data(),
                                        point::bilateral_weights(settings.closeness_sigma, settings.similarity_sigma),
                                        moved.resized(count));
    mark(faired);
  }
};

CudaBaseline::CudaBaseline() : state_(std::make_unique<State>()) {}
CudaBaseline::~CudaBaseline() = default;

void CudaBaseline::run(std::span<const Point> points, const Settings& settings, std::span<Point> out) {
  static_assert(sizeof(Point) == sizeof(float3));
  State& state = *state_;
  if (points.size() <= std::size_t(settings.k) || points.size() > INT_MAX || out.size() != points.size())
    throw std::runtime_error("the baselines need more than k points, at most 2^31, and as many places");
  state.count = points.size();
  state.k = settings.k;
  state.mark(State::start);
  check(cudaMemcpyAsync(state.points.resized(state.count), points.data(), points.size_bytes(), cudaMemcpyHostToDevice));
  state.mark(State::uploaded);
  Grid grid{};
  if (settings.search == Search::dense_grid) grid = state.build_index(settings.resolution);
  state.mark(State::indexed);
  state.search(settings, grid);
  state.mark(State::searched);
  state.move_points(settings);
  check(cudaMemcpyAsync(out.data(), state.moved.data(), out.size_bytes(), cudaMemcpyDeviceToHost));
  state.mark(State::downloaded);
  check(cudaEventSynchronize(state.events[State::downloaded]));
  state.times = {state.between(State::start, State::uploaded),      state.between(State::uploaded, State::indexed),
                 state.between(State::indexed, State::searched),    state.between(State::searched, State::normals_done),
                 state.between(State::normals_done, State::faired), state.between(State::faired, State::downloaded)};
}

const StageTimes& CudaBaseline::times() const { return state_->times; }

std::vector<std::uint32_t> CudaBaseline::neighbors() const {
  const std::size_t count = state_->count, k = state_->k;
  std::vector<std::uint32_t> by_slot(count * k), rows(count * k);
  check(cudaMemcpy(by_slot.data(), state_->lists.data(), by_slot.size() * sizeof(Index), cudaMemcpyDeviceToHost));
  for (std::size_t slot = 0; slot < k; ++slot)
    for (std::size_t i = 0; i < count; ++i) rows[i * k + slot] = by_slot[slot * count + i];
  return rows;
}

bool CudaBaseline::fits(std::span<const Point> points, int resolution) {
  float min[3] = {INFINITY, INFINITY, INFINITY}, max[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (const Point& p : points) {
    const float v[3] = {p.x, p.y, p.z};
    for (int axis = 0; axis < 3; ++axis) {
      min[axis] = std::min(min[axis], v[axis]);
      max[axis] = std::max(max[axis], v[axis]);
    }
  }
  std::size_t free_bytes = 0, all_bytes = 0;
  check(cudaMemGetInfo(&free_bytes, &all_bytes));
  return lay_out(min, max, resolution).size() * sizeof(int) <= free_bytes / 2;
}

}  // namespace paper
