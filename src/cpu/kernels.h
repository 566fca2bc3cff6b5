// SPDX-License-Identifier: Apache-2.0
// The index as the stage kernels see it, and the table of kernels, one per instruction set.
// Points are sorted along a Hilbert curve; 16 consecutive points are a leaf; 16 consecutive leaves have their boxes in
// one BoxGroup, 16 consecutive groups in one of the next level, up to a single group. Boxes are tight, so the tree
// holds occupied space only and adapts to any density.
#pragma once

#include <cstddef>
#include <cstdint>

#include "point/curve.h"
#include "point/method.h"
#include "point/net.h"
#include "point/node_field.h"
#include "point/sensor.h"
#include "point/stages.h"
#include "seam/sample_fits.hpp"

namespace pointfair::cpu {

using point::Index;

inline constexpr int kLeafSize = 16;              // also the number of children of a tree node
inline constexpr int kMaxLevels = 8;              // 16^8 = 2^32 leaves
inline constexpr Index kMaxPoints = 0x7ffffff0u;  // SIMD gathers take signed 32-bit indices

struct Box {
  float min_x, min_y, min_z, max_x, max_y, max_z;
};

// The boxes of 16 children; NaN for children that do not exist, so that no comparison holds for them.
struct BoxGroup {
  float min_x[kLeafSize], min_y[kLeafSize], min_z[kLeafSize];
  float max_x[kLeafSize], max_y[kLeafSize], max_z[kLeafSize];
};

struct IndexView {
  const float *x, *y, *z;  // sorted; padded with NaN to whole leaves
  const Index* original;   // upload index of each sorted point
  Index points;            // valid points
  Index leaves;
  int levels;
  const BoxGroup* level[kMaxLevels];  // level[0] holds the boxes of leaves
  const float* share;                 // of each sorted point, a hash of its position over [0, 1); null without a frame
};

POINTFAIR_INLINE point::Vec3<float> position_of(const IndexView& index, Index at) {
  return {index.x[at], index.y[at], index.z[at]};
}
// Of points in a child's box, none lies before this (point::lies_before).
POINTFAIR_INLINE point::Vec3<float> low_corner(const BoxGroup& group, int child) {
  return {group.min_x[child], group.min_y[child], group.min_z[child]};
}

// The lists of one leaf: list[slot * 16 + lane], sorted positions, kNoNeighbor at the end; nearest first.
struct LeafLists {
  const Index* list;
  int k;
};

// What edges of a mesh reach from the points of one leaf, in sorted order: bit l of lanes[i] is set where the point at
// sorted position at[i] belongs to lane l, of in_radius[i] where it also lies within that point's radius before it
// grows.
struct LeafBalls {
  const Index* at;
  const std::uint16_t *lanes, *in_radius;
  int count;
};

// A neighbour list per point, as LeafLists at list + leaf * stored * 16. Along a mesh, those of each leaf, or balls of
// each leaf; null: there are none.
struct NeighborView {
  int k;       // entries to use
  int stored;  // entries a point that the lists hold, at least k
  const Index* list;
  const LeafLists* rings = nullptr;
  const LeafBalls* balls = nullptr;

  POINTFAIR_INLINE LeafLists of_leaf(Index leaf) const {
    if (rings != nullptr) return rings[leaf];
    return {list + std::size_t(leaf) * std::size_t(stored) * kLeafSize, k};
  }
};

// Where the neighbours of a pack come from: balls along a mesh, lists, or everything within a radius if lists.k is 0.
struct Neighborhoods {
  NeighborView lists;
  point::Radii radii;
};

struct AreaView {
  const float* mean_distance;  // of each sorted point to its 5 nearest; null for weight 1
  int power;                   // 2, 1 or 0
};

// One vector of each sorted point; a normal is zero where there is none.
struct VectorsOut {
  float *x, *y, *z;
};
struct VectorsView {
  const float *x, *y, *z;
};

// Where the notes of the packs of some leaves are written, and read in the same order (src/cpu/notes.h): none if `next`
// is null. Behind `end` there is room for the kBytesOfNoNotes of each leaf.
struct Notes {
  std::uint8_t* next;
  const std::uint8_t* end;
};
inline constexpr std::size_t kBytesOfNoNotes = 8;  // two for each pack of four

// What the net of method learned reads and writes of each sorted point.
struct NetCloud {
  const Index* lists[point::net::kScales];  // rows of point::net::kNeighbors sorted positions
  const point::net::Place* places;          // layers read them with normals on the side of the neighbours
  std::uint8_t* turned;                     // 1: the normal is to be turned for that
  point::Vec3<float>* sides;
  float* sizes[point::net::kScales];
  std::uint8_t* states;       // rows of point::net::kChannels, as the next
  std::int16_t* stored;       // for the neighbours
  point::Vec3<float>* steps;  // from where the default run put the point, in noises
};

// One round in which points slide apart (src/point/net.h).
struct NetSlide {
  const point::net::Place* starts;
  const Index* list;               // of the finest scale
  const point::Vec3<float>* from;  // with room for one float behind the last
  point::Vec3<float>* to;
};

// Each kernel treats the 16 points of one leaf.
struct Kernels {
  const char* name;
  // Keys of the points `elements` names (ascending places in the low half), into the high half: position along the
  // Hilbert curve of 2^10 steps an axis over the cube from (x, y, z) with `scale` steps a unit.
  void (*hilbert_keys)(const float* xyz, std::uint64_t* elements, std::size_t count, float x, float y, float z,
                       float scale);
  // The same with the first or the second digit of the point's place on the curve of src/point/curve.h; for the second,
  // elements are in any order.
  void (*curve_keys)(const float* xyz, std::uint64_t* elements, std::size_t count, point::CurveCube, bool second);
  // The k nearest other points within `squared_limit`: out[slot * 16 + lane]. k <= 1024.
  void (*nearest)(const IndexView&, Index leaf, int k, float squared_limit, Index* out);
  // Squared distances to the k nearest other points, ascending: out[slot * 16 + lane], infinite at the end. k <= 64.
  // They are found faster where all are below `likely`, which may be infinite.
  void (*nearest_distances)(const IndexView&, Index leaf, int k, float likely, float* out);
  // The same of lists that `nearest` gave.
  void (*listed_distances)(const IndexView&, Index leaf, const Index* list, int count, float* out);
  // Constrained neighbourhoods of the leaf's points among the `count` nearest of each, as `nearest` gives them; bit l
  // of the result is set if no candidate beyond those could join that of lane l. count <= 1024.
  unsigned (*grow)(const IndexView&, Index leaf, const Index* candidates, int count, int k, float reach, Index* list);
  // The squares of point::node_value at the leaf's points; `values` of the field are not null.
  void (*squared_levels)(const IndexView&, Index leaf, const point::NodeField&, float* out);
  // R_i^2, from such distances to the `min_neighbors` nearest; what it is made of is in `radii`. `squared_reach_level`:
  // K_i^2 of the leaf's points; null: 1.
  void (*squared_radii)(const IndexView&, Index leaf, const float* squared_distances, const point::Radii& radii,
                        const float* squared_reach_level, float* out);
  // The mean of the first `count` distances, or of as many as there are.
  void (*mean_distances)(const float* squared_distances, int count, float* out);
  // neighbor_counts receives how many neighbours each point has; what walks within a radius met is noted.
  void (*normals)(const IndexView&, Index leaf, Neighborhoods, const point::NormalSettings&, VectorsOut,
                  unsigned* neighbor_counts, Notes&);
  // One round of Eq. 9, of which each point takes its share (null: all); `squared_growth` receives what Eq. 20
  // multiplies R_i^2 of each sorted point by, unless it is null.
  void (*filter_normals)(const IndexView&, Index leaf, Neighborhoods, const point::NormalSettings&, VectorsView,
                         const float* further_share, VectorsOut, float* squared_growth, Notes&);
  // The bilateral method: moved positions, point after point.
  void (*fair)(const IndexView&, Index leaf, Neighborhoods, VectorsView, AreaView, const point::FairingSettings&,
               point::Sensors, point::Levels, Notes&, float* xyz);
  // The other methods: the displacements of all points, then from them the moved positions.
  void (*displacements)(const IndexView&, Index leaf, Neighborhoods, VectorsView, AreaView, const point::MethodRule&,
                        VectorsOut);
  void (*move)(const IndexView&, Index leaf, Neighborhoods, VectorsView displacements, AreaView,
               const point::MethodRule&, point::Sensors, float* xyz);
  // How many neighbours each point has, and the least of `values` over it and them.
  void (*survey)(const IndexView&, Index leaf, Neighborhoods, const float* values, float* counts, float* least);
  // The k nearest points in another index for those of a leaf, as `nearest` gives them; `own`: where each of the leaf's
  // points lies there, which does not count, -1 where it does not. `start`: a leaf near them there. k <= 64.
  void (*nearest_there)(const IndexView& here, Index leaf, const IndexView& there, const int* own, Index start, int k,
                        Index* out);
  // For the search of one place. Squared distances from it to the boxes of a node's children, or to the points of a
  // leaf; bit i of the result is set if number i exists and is at most `limit`.
  unsigned (*child_gaps)(const BoxGroup&, point::Vec3<float> place, float limit, float* gaps);
  unsigned (*leaf_distances)(const IndexView&, Index leaf, point::Vec3<float> place, float limit, float* squared);
  SampleFits fits;
};

// Of the net, for the points from `first` to before `last`.
struct NetKernels {
  const char* name;
  void (*slide)(const NetSlide&, Index first, Index last);
  void (*begin)(const NetCloud&, const point::net::Weights&, Index first, Index last);
  void (*store)(const NetCloud&, const point::net::Weights&, int layer, Index first, Index last);  // before each layer
  void (*layer)(const NetCloud&, const point::net::Weights&, int layer, Index first, Index last);
};

// The k nearest other points within `squared_limit` of the one at sorted position `at`, for the kernels where a point
// has nothing in common with those of its leaf: list[slot * 16].
void find_alone(const IndexView& index, Index at, int k, float squared_limit, Index* list);

// The kernels of the best instruction set that this processor has; POINTFAIR_ISA=sse2|avx2|avxvnni|avx512 asks for a
// lesser one. Those of VNNI are the net's alone.
const Kernels& best_kernels();
const NetKernels& best_net_kernels();
bool has_avx2();
bool has_avx512();
bool has_avx512_vnni();
bool has_avx_vnni();

}  // namespace pointfair::cpu
