// SPDX-License-Identifier: Apache-2.0
#include "cuda/stages/copies.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 256;

template <class Body>
__global__ void __launch_bounds__(kBlock) for_copies(const CopyOnCard* copies, std::size_t count, Body body) {
  const std::size_t i = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (i < count) body(copies[i]);
}

struct Hide {
  Point* points;
  __device__ void operator()(const CopyOnCard& copy) const {
    const float nan = __int_as_float(0x7fffffff);
    points[copy.point] = {nan, nan, nan};
  }
};
struct Show {
  Point* points;
  __device__ void operator()(const CopyOnCard& copy) const { points[copy.point] = {copy.x, copy.y, copy.z}; }
};
struct Follow {
  Point* values;
  __device__ void operator()(const CopyOnCard& copy) const { values[copy.point] = values[copy.first]; }
};
struct FollowUnlessHeld {
  Point* points;
  const std::uint8_t* held;
  __device__ void operator()(const CopyOnCard& copy) const {
    const bool follows = held[copy.point] == 0 && held[copy.first] == 0;
    points[copy.point] = follows ? points[copy.first] : Point{copy.x, copy.y, copy.z};
  }
};

template <class Body>
void run(Context& context, const char* what, const DeviceArray<CopyOnCard>& copies, const Body& body) {
  if (copies.size() == 0) return;
  launch(context, what, for_copies<Body>, blocks_for(copies.size(), kBlock), kBlock, copies.data(), copies.size(),
         body);
}

}  // namespace

void CopiesAside::forget() {
  copies_.clear();
  on_card_.release();
}

void CopiesAside::set(std::vector<Copy> copies) {
  copies_ = std::move(copies);
  std::vector<CopyOnCard> packed;
  packed.reserve(copies_.size());
  for (const Copy& c : copies_) packed.push_back({c.point, c.first, c.place.x, c.place.y, c.place.z});
  on_card_.upload(packed, "uploading copies");
  context_.finish();  // before the packed ones go
}

void CopiesAside::hide(Point* points) const { run(context_, "hiding copies", on_card_, Hide{points}); }
void CopiesAside::show(Point* points) const { run(context_, "showing copies", on_card_, Show{points}); }
void CopiesAside::follow(Point* values) const { run(context_, "following firsts", on_card_, Follow{values}); }
void CopiesAside::follow(Point* points, const std::uint8_t* held) const {
  run(context_, "following firsts", on_card_, FollowUnlessHeld{points, held});
}

}  // namespace pointfair::cuda
