// SPDX-License-Identifier: Apache-2.0
// The paper's index and search (III.B, III.C, figures 1 to 3): a dense grid of cubes over the bounding box, a linked
// list of points a cell built with atomicExch, points where they were, a thread a point. The lists of neighbours stay
// in registers, which the paper's cards had not enough of.
#pragma once

#include "paper/nearest.cuh"

namespace paper {

inline constexpr int kNobody = -1;  // the end of a linked list

struct Grid {
  float origin[3];
  float cell;   // side of a cube
  float slack;  // more than what rounding can move a point or a plane
  int cells[3];
  int* head;  // a cell's first point
  int* link;  // a point's next in its cell

  __host__ __device__ std::size_t size() const { return std::size_t(cells[0]) * cells[1] * cells[2]; }
  __device__ int along(int axis, float coordinate) const {
    return min(max(static_cast<int>((coordinate - origin[axis]) / cell), 0), cells[axis] - 1);
  }
  __device__ std::size_t at(int x, int y, int z) const { return (std::size_t(z) * cells[1] + y) * cells[0] + x; }
};

// The paper's algorithm 1.
__global__ void build_grid(const float3* points, int count, Grid grid) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= count) return;
  const float3 p = points[i];
  grid.link[i] = atomicExch(&grid.head[grid.at(grid.along(0, p.x), grid.along(1, p.y), grid.along(2, p.z))], i);
}

struct CellBox {
  int low[3], high[3];
};

// The paper's algorithm 2: the box of cells around a point grows by a cell in each direction in which its border is
// nearer than the farthest of the k found, in all directions while fewer than k are found.
template <int kLength>
class GridSearch {
 public:
  __device__ GridSearch(const Grid& grid, const float3* points, int query)
      : grid_(grid),
        points_(points),
        query_(query),
        position_{points[query].x, points[query].y, points[query].z},
        nearest_(points) {
    const float p[3] = {position_.x, position_.y, position_.z};
    for (int axis = 0; axis < 3; ++axis) box_.low[axis] = box_.high[axis] = grid.along(axis, p[axis]);
    visit_cells(box_.low[0], box_.high[0], box_.low[1], box_.low[2]);
  }
  __device__ void run() {
    for (;;) {
      const CellBox before = box_;
      if (!grow()) return;
      visit_new(before);
    }
  }
  __device__ const Nearest<kLength>& nearest() const { return nearest_; }

 private:
  __device__ bool needs(float gap) const {
    gap = fmaxf(gap - grid_.slack, 0.0f);
    return !nearest_.full() || gap * gap <= nearest_.worst();
  }
  __device__ bool grow() {
    const float p[3] = {position_.x, position_.y, position_.z};
    bool grown = false;
#pragma unroll
    for (int axis = 0; axis < 3; ++axis) {
      const float low = grid_.origin[axis] + static_cast<float>(box_.low[axis]) * grid_.cell;
      const float high = grid_.origin[axis] + static_cast<float>(box_.high[axis] + 1) * grid_.cell;
      const bool down = box_.low[axis] > 0 && needs(p[axis] - low);
      const bool up = box_.high[axis] + 1 < grid_.cells[axis] && needs(high - p[axis]);
      box_.low[axis] -= down;
      box_.high[axis] += up;
      grown = grown || down || up;
    }
    return grown;
  }
  // Cells of the box that were not in it before.
  __device__ void visit_new(const CellBox& before) {
    for (int z = box_.low[2]; z <= box_.high[2]; ++z) {
      for (int y = box_.low[1]; y <= box_.high[1]; ++y) {
        const bool row_was_inside =
            z >= before.low[2] && z <= before.high[2] && y >= before.low[1] && y <= before.high[1];
        if (row_was_inside) {
          visit_cells(box_.low[0], before.low[0] - 1, y, z);
          visit_cells(before.high[0] + 1, box_.high[0], y, z);
        } else {
          visit_cells(box_.low[0], box_.high[0], y, z);
        }
      }
    }
  }
  __device__ void visit_cells(int first, int last, int y, int z) {
    for (int x = first; x <= last; ++x) {
      for (int i = grid_.head[grid_.at(x, y, z)]; i != kNobody; i = grid_.link[i]) {
        if (i == query_) continue;
        const float3 q = points_[i];
        const Vec offset = Vec{q.x, q.y, q.z} - position_;
        nearest_.offer(pointfair::point::neighbor_key(pointfair::point::squared_length(offset), static_cast<Index>(i)));
      }
    }
  }

  const Grid& grid_;
  const float3* points_;
  int query_;
  Vec position_;
  CellBox box_;
  Nearest<kLength> nearest_;
};

template <int kLength>
__global__ void search_grid(const float3* points, int count, const __grid_constant__ Grid grid, Index* lists) {
  const int query = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (query >= count) return;
  GridSearch<kLength> search(grid, points, query);
  search.run();
  search.nearest().store(lists, count, query);
}

}  // namespace paper
