// SPDX-License-Identifier: Apache-2.0
#include <bit>
#include <cstring>
#include <limits>

#include "cuda/runtime/callers_points.cuh"
#include "cuda/runtime/callers_rows.cuh"
#include "cuda/runtime/warp.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 256;
constexpr int kBlocks = 8;  // of a processor
constexpr std::size_t kRoom = 2 * kSampledPositions;

// to_offset of src/io/offset.hpp.
template <class T>
__global__ void __launch_bounds__(kBlock)
    take_points(Rows<const T> from, std::size_t count, double x, double y, double z, float* to, T* own) {
  const std::size_t i = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (i >= count) return;
  const double origin[3] = {x, y, z};
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) {
    const T value = from.at(i, axis);
    if (own != nullptr) own[3 * i + axis] = value;
    // where the origin is 0, floats are taken as they are
    if constexpr (sizeof(T) == sizeof(float)) {
      to[3 * i + axis] = own == nullptr ? value : static_cast<float>(static_cast<double>(value) - origin[axis]);
    } else {
      to[3 * i + axis] = static_cast<float>(value - origin[axis]);
    }
  }
}

__device__ bool same_bits(float a, float b) {
  return __float_as_uint(a) == __float_as_uint(b) || (isnan(a) && isnan(b));
}

// moved_value of src/io/offset.hpp.
template <class T>
__global__ void __launch_bounds__(kBlock) give_points(const T* own, const float* before, const float* after,
                                                      std::size_t count, double x, double y, double z, Rows<T> to) {
  const std::size_t i = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (i >= count) return;
  const double origin[3] = {x, y, z};
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) {
    const T value = own[3 * i + axis];
    const float from = before[3 * i + axis], now = after[3 * i + axis];
    const double moved =
        isfinite(from) ? static_cast<double>(value) + (static_cast<double>(now) - from + 0.0) : origin[axis] + now;
    to.at(i, axis) = same_bits(from, now) || from == now ? value : static_cast<T>(moved);
  }
}

template <class T>
__global__ void __launch_bounds__(kBlock) give_values(const float* from, std::size_t count, Rows<T> to) {
  const std::size_t i = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (i >= count) return;
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) to.at(i, axis) = from[3 * i + axis];
}

// Doubles as integers of the same order.
__device__ unsigned long long ordered_double(double x) {
  const long long bits = __double_as_longlong(x);
  return static_cast<unsigned long long>(bits) ^ (static_cast<unsigned long long>(bits >> 63) | 0x8000000000000000ull);
}
double from_ordered(unsigned long long o) {
  return std::bit_cast<double>((o & 0x8000000000000000ull) != 0 ? o ^ 0x8000000000000000ull : ~o);
}

__global__ void clear_sample(PositionSampleState* state) {
  for (unsigned long long& least : state->least) least = ~0ull;
  for (unsigned long long& most : state->most) most = 0;
  state->chosen = 0;
}

// OriginSample::offer of src/io/origin_sample.cpp.
template <class T>
__global__ void __launch_bounds__(kBlock)
    sample_positions(Rows<const T> from, std::size_t count, unsigned long long limit, PositionSampleState* state,
                     double* chosen, std::size_t room) {
  double least[3], most[3];
  bool any = false;
  for (std::size_t i = std::size_t(blockIdx.x) * kBlock + threadIdx.x; i < count;
       i += std::size_t(gridDim.x) * kBlock) {
    const double p[3] = {from.at(i, 0), from.at(i, 1), from.at(i, 2)};
    if (is_sampled(p, limit)) {
      const unsigned long long place = atomicAdd(&state->chosen, 1ull);
#pragma unroll
      for (int axis = 0; axis < 3 && place < room; ++axis) chosen[3 * place + axis] = p[axis];
    }
    if (!isfinite(p[0] + p[1] + p[2])) continue;
#pragma unroll
    for (int axis = 0; axis < 3; ++axis) {
      least[axis] = any ? fmin(least[axis], p[axis]) : p[axis];
      most[axis] = any ? fmax(most[axis], p[axis]) : p[axis];
    }
    any = true;
  }
  // one atomic a warp and number at most, and mostly none: the numbers are hardly ever read
#pragma unroll
  for (int axis = 0; axis < 3; ++axis) {
    unsigned long long low = any ? ordered_double(least[axis]) : ~0ull, high = any ? ordered_double(most[axis]) : 0;
    for (int step = kWarp / 2; step > 0; step /= 2) {
      low = min(low, __shfl_xor_sync(kAllLanes, low, step));
      high = max(high, __shfl_xor_sync(kAllLanes, high, step));
    }
    if (lane_number() == 0 && low < state->least[axis]) atomicMin(&state->least[axis], low);
    if (lane_number() == 0 && high > state->most[axis]) atomicMax(&state->most[axis], high);
  }
}

template <class Memory>
bool is_packed(const PointsOnCard<Memory>& points) {
  return points.type == ScalarType::float32 && points.row_stride == 3 && points.column_stride == 1;
}

void copy_packed(const Context& context, const void* from, void* to, std::size_t count) {
  if (count == 0) return;
  check(cudaMemcpyAsync(to, from, count * sizeof(Point), cudaMemcpyDeviceToDevice, context.stream()),
        "copying points on the card");
}

}  // namespace

void require_on_card(const void* data, std::size_t count, ScalarType type, int card, int of_context) {
  if (type != ScalarType::float32 && type != ScalarType::float64)
    throw Error(ErrorKind::usage, "points on a card must be float32 or float64");
  if (count == 0) return;
  const auto refuse = [&](const std::string& where) {
    throw Error(ErrorKind::usage, "the points lie " + where + ", and this pipeline computes on card " +
                                      std::to_string(of_context) +
                                      ": copy them there, or make the pipeline for the place where they are");
  };
  cudaPointerAttributes attributes{};
  const cudaError_t status = cudaPointerGetAttributes(&attributes, data);
  cudaGetLastError();
  const bool on_card =
      status == cudaSuccess && (attributes.type == cudaMemoryTypeDevice || attributes.type == cudaMemoryTypeManaged);
  if (!on_card) refuse("in host memory");
  if (attributes.type == cudaMemoryTypeDevice && attributes.device != of_context)
    refuse("on card " + std::to_string(attributes.device));
  if (card != of_context) refuse("on card " + std::to_string(card));
}

CallersPoints::CallersPoints(Context& context)
    : context_(context), side_(context), own_(context), state_(context), chosen_(context) {}

void CallersPoints::forget() {
  origin_ = {};
  type_ = ScalarType::float32;
  own_.release();
}

void CallersPoints::take(const DevicePoints& from, const Position& origin, Point* to) {
  forget();
  origin_ = origin;
  type_ = from.type;
  const bool keeps = type_ == ScalarType::float64 || origin != Position{};
  if (!keeps && is_packed(from)) return copy_packed(context_, from.data, to, from.count);
  if (from.count == 0) return;
  with_type(type_, [&]<class T>(T*) {
    if (keeps) own_.resize(3 * from.count * sizeof(T));
    take_points<T><<<blocks_for(from.count, kBlock), kBlock, 0, context_.stream()>>>(
        rows_of<const T>(from), from.count, origin[0], origin[1], origin[2], &to->x, reinterpret_cast<T*>(own_.data()));
  });
  check(cudaGetLastError(), "taking points");
}

void CallersPoints::give(const Point* before, const Point* after, const DeviceOutput& to) const {
  if (to.type != type_) throw Error(ErrorKind::usage, "the output has another type than what was loaded");
  if (own_.data() == nullptr) return give_plain(after, to);
  with_type(type_, [&]<class T>(T*) {
    give_points<T><<<blocks_for(to.count, kBlock), kBlock, 0, context_.stream()>>>(
        reinterpret_cast<const T*>(own_.data()), &before->x, &after->x, to.count, origin_[0], origin_[1], origin_[2],
        rows_of<T>(to));
  });
  check(cudaGetLastError(), "giving points");
}

void CallersPoints::give_plain(const Point* from, const DeviceOutput& to) const {
  if (is_packed(to)) return copy_packed(context_, from, to.data, to.count);
  if (to.count == 0) return;
  with_type(to.type, [&]<class T>(T*) {
    give_values<T><<<blocks_for(to.count, kBlock), kBlock, 0, context_.stream()>>>(&from->x, to.count, rows_of<T>(to));
  });
  check(cudaGetLastError(), "giving points");
}

void CallersPoints::await_points() {
  state_.resize(1);
  if (chosen_.size() < kRoom) chosen_.resize(kRoom);
  side_.fork();
}

void CallersPoints::start_sample(const DevicePoints& from) {
  const cudaStream_t stream = side_.stream();
  const std::size_t room = chosen_.size(), brought = std::min(room, from.count);
  const unsigned blocks =
      std::min(blocks_for(from.count, kBlock), static_cast<unsigned>(context_.processors() * kBlocks));
  clear_sample<<<1, 1, 0, stream>>>(state_.data());
  if (brought > 0)  // all of it is fetched, before it is known how much was chosen
    check(cudaMemsetAsync(chosen_.data(), 0, brought * sizeof(Position), stream), "clearing a sample");
  with_type(from.type, [&]<class T>(T*) {
    sample_positions<T><<<blocks, kBlock, 0, stream>>>(rows_of<const T>(from), from.count, sample_limit(from.count),
                                                       state_.data(), reinterpret_cast<double*>(chosen_.data()), room);
  });
  check(cudaGetLastError(), "sampling positions");
  fetched_.resize(brought);
  check(
      cudaMemcpyAsync(fetched_state_.get(), state_.data(), sizeof(PositionSampleState), cudaMemcpyDeviceToHost, stream),
      "sampling positions");
  if (brought > 0)
    check(cudaMemcpyAsync(fetched_.get(), chosen_.data(), brought * sizeof(Position), cudaMemcpyDeviceToHost, stream),
          "sampling positions");
  sampled_.record(stream);
}

std::vector<Position> CallersPoints::sample(const DevicePoints& from) {
  check(cudaEventSynchronize(sampled_.get()), "sampling positions");
  if (fetched_state_.get()->chosen > chosen_.size()) {  // many points share a place
    chosen_.resize(fetched_state_.get()->chosen);
    side_.fork();
    start_sample(from);
    check(cudaEventSynchronize(sampled_.get()), "sampling positions");
  }
  const PositionSampleState& state = *fetched_state_.get();
  if (state.chosen >= kFewSampled || from.count <= kSampledPositions)
    return {fetched_.get(), fetched_.get() + state.chosen};
  Position least, most;
  for (int axis = 0; axis < 3; ++axis) {
    least[axis] = from_ordered(state.least[axis]);
    most[axis] = from_ordered(state.most[axis]);
  }
  if (state.most[0] == 0) {  // no position is finite
    least.fill(std::numeric_limits<double>::infinity());
    most.fill(-std::numeric_limits<double>::infinity());
  }
  return {least, most};
}

}  // namespace pointfair::cuda
