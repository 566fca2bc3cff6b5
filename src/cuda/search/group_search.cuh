// SPDX-License-Identifier: Apache-2.0
// The k <= 64 nearest other points of all points of a leaf at once, of the same tree or, with kElsewhere, of another:
// one warp, a query a lane. The warp walks the tree for the union of what its lanes need, gathers the candidates in
// shared memory, and every lane looks at each.
//
// Keys. A candidate is one 32-bit number: 22 bits of squared distance in units of (leaf diagonal / 2047)^2, 10 bits of
// slot in the table of candidates. With coordinates relative to the middle of the leaf's box, |c - q|^2 = |c|^2 - 2 q.c
// + |q|^2; the last term is the same for all candidates of a lane and left out, so a lane's keys are lower by |q|^2
// than the squared distances, and 2^20 is added, since |q|^2 is below that. Distances are computed with rounding errors
// that together stay below kUnsure / 2 units, so two candidates whose keys differ by kUnsure units are in their true
// order. A lane's result stands only if the last key kept and the least key rejected differ by that much; otherwise, or
// if the table overflows, the query goes to the exact search. Those kept are put in exact order at the end.
//
// Rounding. From the box's low corner the queries' coordinates are at most 2047, from its middle 1024; the candidates',
// where it matters, 1774 more. Each is rounded three times, so a difference of two is off by less than 2^-11 and a
// squared distance of up to 1774^2 by less than 2 * 1774 * sqrt(3) * 2^-11 = 3 units. Three additions for |c|^2 and
// three for -2 q.c stay below 2^25, so each rounds by one unit at most, and the exact squared distance itself is
// rounded by less than one: 10 in all. Below a quarter of the diagonal, |c| is at most 1536 and the six sums are below
// 2^24: 0.6 + 6 / 2 + 0.1 units.
#pragma once

#include "cuda/runtime/network.cuh"
#include "cuda/search/list_order.cuh"
#include "cuda/search/query_boxes.cuh"

namespace pointfair::cuda {

inline constexpr int kSlotBits = 10;
inline constexpr Index kSlots = 1u << kSlotBits;
inline constexpr float kDiagonalSteps = 2047.0f;
inline constexpr float kUnitsBase = 8388608.0f;        // 2^23: floats from here on count whole units
inline constexpr float kUnitsShift = 1048576.0f;       // 2^20: see above
inline constexpr float kLargestDistance = 3145000.0f;  // units; with kUnitsShift below 2^22
inline constexpr unsigned kUnsure = 20;                // units
inline constexpr unsigned kShort = 1u << 18, kUnsureIfShort = 8;
inline constexpr int kChunk = 8;  // candidates between two looks at the stacks

__device__ __forceinline__ unsigned units_of(unsigned key) { return key >> kSlotBits; }

// kWide: room for more candidates at the price of fewer warps at once, for clouds whose noise is wide against their
// spacing.
template <int kList, bool kWide>
struct GroupShape {
  static constexpr int kBatch = kList <= 8 ? 8 : 16;
  static constexpr unsigned kStack = kBatch + kChunk;  // candidates a lane can hold before they are merged
  static constexpr unsigned kMostSlots = kList > 8 ? kSlots
                                         : kWide   ? 768
                                                   : 640;  // what fits beside the registers of a processor
};

// What a warp keeps in shared memory. `close` is in scaled coordinates, slot in w; `square` is kUnitsBase + kUnitsShift
// more than its squared length.
template <int kList, bool kWide>
struct GroupMemory {
  static constexpr int kClose = 2 * kWarp + kChunk;
  float4 close[kClose];
  alignas(16) float square[kClose];
  unsigned stack[GroupShape<kList, kWide>::kStack][kWarp];
  Index position[GroupShape<kList, kWide>::kMostSlots];
};

template <int kList, bool kWide, bool kElsewhere = false>
class GroupSearch {
 public:
  static constexpr int kBatch = GroupShape<kList, kWide>::kBatch;
  static constexpr unsigned kStack = GroupShape<kList, kWide>::kStack;
  static constexpr unsigned kEntry = kWarp * sizeof(unsigned);  // from one place of a stack to the next, bytes
  static constexpr float kNotSearching = -1.0f;                 // a limit
  static constexpr float kFar = 1e18f;                          // fills places of `square`; beyond every limit

  __device__ __forceinline__ GroupSearch(const Tree& tree, GroupMemory<kList, kWide>& memory, Index leaf)
      : GroupSearch(tree, memory, leaf, tree.points[leaf * kLeafSize + lane_number()],
                    leaf * kLeafSize + lane_number()) {}
  // Of a query each lane, which stands at `at` in the tree, kNoNeighbor if it is not there; `leaf`: one near them.
  __device__ __forceinline__ GroupSearch(const Tree& tree, GroupMemory<kList, kWide>& memory, Index leaf, float4 query,
                                         Index at)
      : tree_(tree),
        memory_(memory),
        leaf_(leaf),
        at_(at),
        position_(position_of(query)),
        active_(is_present(query)),
        boxes_(position_, active_) {
    Box all = boxes_.all();
    if constexpr (kElsewhere) {
      const float4 p = tree.points[leaf * kLeafSize + lane_number()];
      const Box near = warp_box(position_of(p), is_present(p));  // so wide that most neighbours are within a diagonal
      all = {{fminf(all.min.x, near.min.x), fminf(all.min.y, near.min.y), fminf(all.min.z, near.min.z)},
             {fmaxf(all.max.x, near.max.x), fmaxf(all.max.y, near.max.y), fmaxf(all.max.z, near.max.z)}};
    }
    low_ = all.min;
    half_ = 0.5f * (all.max - all.min);
    squared_diagonal_ = QueryBoxes::squared_diagonal(all);
    scale_ = kDiagonalSteps * rsqrtf(squared_diagonal_);
    stack_ = shared_address(&memory.stack[0][lane_number()]);
    top_ = stack_;
  }

  __device__ Index candidates() const { return slots_; }
  __device__ bool any_dropped() const { return any_dropped_; }
  __device__ bool in_one_place() const { return squared_diagonal_ == 0; }
  // Leaves with all points in one place, or too large or small to be scaled, are for the exact searches.
  __device__ __forceinline__ bool suits() const { return squared_diagonal_ > 1e-30f && squared_diagonal_ < 1e30f; }

  // Returns false if there were too many candidates; then nothing is known of any lane.
  __device__ __forceinline__ bool run(int k, float squared_limit) {
    begin(k, squared_limit);
    search_own_leaf();
    // The leaves beside it on the curve come first, for an early limit: a bit each, from `first` on.
    constexpr Index kBeside = kList <= 16 ? 1 : 2;
    Index first = leaf_ - kBeside;
    unsigned pending = leaves_beside(kBeside);
    const auto near = [&](const BoxGroup& group) { return is_near(box_of_lane(group)); };
    GroupWalk walk(tree_, tree_.root_over(leaf_));
    bool beside = true, more = true;
    Vec points = points_of(first, pending);
    while (more) {
      if (pending != 0) {
        const Index leaf = first + first_of(pending);
        pending &= pending - 1;
        const Vec points_ahead = points_of(first, pending);  // on their way while `leaf` is looked at
        if (!collect(leaf, points)) return false;
        points = points_ahead;
      }
      const bool rest = beside && pending == 0;
      if (!beside && pending == 0) {
        more = walk.next(near);
        first = walk.first_leaf();
        pending = more ? walk.near_leaves() & ~seen_from(first, kBeside) : 0u;
        points = points_of(first, pending);
      }
      if (rest || !more || close_ >= kWarp) look_at_close(rest || !more);
      if (rest) drop_far_lanes();
      beside = beside && !rest;
    }
    return true;
  }

  // Whether this lane's list is certainly right as a set.
  __device__ __forceinline__ bool certain() const {
    const unsigned last = units_of(list_[kList - 1]);
    if (!searches()) return !active_;
    const float distance = kUnitsBase + float(last) - no_distance_;  // of the last
    const bool separate = units_of(rejected_) >= last + (distance < float(kShort) ? kUnsureIfShort : kUnsure);
    const bool all_in_reach = limited_ || distance + float(kUnsure) <= kLargestDistance;
    return all_in_reach && (separate || rejected_ == ~0u);
  }
  __device__ __forceinline__ bool active() const { return active_; }
  // After run(): a squared distance that this lane's k-th neighbour is not beyond; infinite if none is known.
  __device__ __forceinline__ float bound() const {
    const float units = searches() ? limit_ - no_distance_ : dropped_at_;
    return list_[kList - 1] != ~0u ? units * units_to_squared() : __int_as_float(0x7f800000);
  }
  __device__ Index at() const { return at_; }

  // Writes the k positions in exact order, those beyond the limit left out.
  __device__ __forceinline__ void write(int k, float squared_limit, Index* list, bool wanted) {
    float distance[kList];
    Index found[kList];
    const int first = kList - k;
#pragma unroll
    for (int i = 0; i < kList; ++i) {
      const bool real = i >= first && list_[i] != ~0u;
      found[i] = real ? memory_.position[list_[i] & (kSlots - 1)] : point::kNoNeighbor;
      distance[i] = i < first ? static_cast<float>(i - kList) : __int_as_float(0x7f800000);
      if (!real) continue;
      const float d = point::squared_length(position_of(tree_.points[found[i]]) - position_);
      const bool inside = d <= squared_limit;
      distance[i] = inside ? d : distance[i];
      found[i] = inside ? found[i] : point::kNoNeighbor;
    }
    const bool tied = order_by_distance(distance, found, wanted);
    list += lane_number();
#pragma unroll
    for (int i = 0; i < kList; ++i)
      if (i >= first && wanted) list[(i - first) * kWarp] = found[i];
    if (tied && wanted) order_ties(tree_.points, position_, k, list);
  }

 private:
  __device__ __forceinline__ void begin(int k, float squared_limit) {
    // The first places of the list hold keys below all others where k is smaller than it.
#pragma unroll
    for (int i = 0; i < kList; ++i) list_[i] = i < kList - k ? 0u : ~0u;
    const Vec scaled = scaled_of(position_);
    const float limit_units = squared_limit * (scale_ * scale_) * 1.0001f + float(2 * kUnsure);
    limited_ = limit_units < kLargestDistance;
    no_distance_ = kUnitsBase + kUnitsShift - point::squared_length(scaled);
    limit_ = active_ ? no_distance_ + floorf(fminf(limit_units, kLargestDistance)) : kNotSearching;
    update_reach();
    query_ = {-2.0f * scaled.x, -2.0f * scaled.y, -2.0f * scaled.z};
    const Index of_leaf = leaf_ * kLeafSize + lane_number();
    put(lane_number(), kElsewhere ? scaled_of(position_of(tree_.points[of_leaf])) : scaled, 1 + lane_number(), of_leaf);
    slots_ = 1 + kWarp;  // slot 0 stays free, so that every key is above 0
    own_slot_ = !kElsewhere ? 1 + lane_number() : at_ / kLeafSize == leaf_ ? 1 + at_ % kLeafSize : 0;
    __syncwarp();
  }

  __device__ __forceinline__ Vec scaled_of(Vec p) const {
    return {((p.x - low_.x) - half_.x) * scale_, ((p.y - low_.y) - half_.y) * scale_,
            ((p.z - low_.z) - half_.z) * scale_};
  }
  __device__ __forceinline__ void put(unsigned place, Vec scaled, unsigned slot, Index position) {
    memory_.close[place] = {scaled.x, scaled.y, scaled.z, __uint_as_float(slot)};
    memory_.square[place] = __fmaf_rn(
        scaled.z, scaled.z, __fmaf_rn(scaled.y, scaled.y, __fmaf_rn(scaled.x, scaled.x, kUnitsBase + kUnitsShift)));
    memory_.position[slot] = position;
  }

  // Squared distance in units, less |q|^2, on top of 2^23 + 2^20.
  __device__ __forceinline__ float distance_to(float4 candidate, float square) const {
    return __fmaf_rn(candidate.z, query_.z, __fmaf_rn(candidate.y, query_.y, __fmaf_rn(candidate.x, query_.x, square)));
  }
  __device__ __forceinline__ static unsigned key_of(float distance, float4 candidate) {
    return (__float_as_uint(distance) << kSlotBits) + __float_as_uint(candidate.w);  // the exponent is shifted out
  }
  // Four squares at once.
  __device__ __forceinline__ float4 squares_from(unsigned place) const {
    return *reinterpret_cast<const float4*>(&memory_.square[place]);
  }

  __device__ __forceinline__ void search_own_leaf() {
#pragma unroll 1
    for (unsigned start = 0; start < kWarp; start += kBatch) {
      unsigned batch[kBatch];
#pragma unroll
      for (int i = 0; i < kBatch; i += 4) {
        const float4 four = squares_from(start + i);
        const float squares[4] = {four.x, four.y, four.z, four.w};
#pragma unroll
        for (int j = 0; j < 4; ++j) {
          const float4 candidate = memory_.close[start + i + j];
          const float distance = distance_to(candidate, squares[j]);
          batch[i + j] = distance <= limit_ && 1 + start + i + j != own_slot_ ? key_of(distance, candidate) : ~0u;
        }
      }
      merge_batch(list_, batch, rejected_);
    }
    __syncwarp();
    update_limit();
  }

  // Squared distance of two boxes, rounded any way: `reach` has room for that.
  __device__ __forceinline__ static float gap_of(const Box& a, const Box& b) {
    const float x = fmaxf(fmaxf(a.min.x - b.max.x, b.min.x - a.max.x), 0.0f);
    const float y = fmaxf(fmaxf(a.min.y - b.max.y, b.min.y - a.max.y), 0.0f);
    const float z = fmaxf(fmaxf(a.min.z - b.max.z, b.min.z - a.max.z), 0.0f);
    return __fmaf_rn(z, z, __fmaf_rn(y, y, x * x));
  }
  __device__ __forceinline__ bool is_near(const Box& box) const {
    bool near = gap_of(box, boxes_.box[0]) <= boxes_.reach[0];
    if (boxes_.split) near = near || gap_of(box, boxes_.box[1]) <= boxes_.reach[1];
    return near;
  }

  __device__ __forceinline__ static Index first_of(unsigned pending) {
    return static_cast<Index>(__ffs(static_cast<int>(pending)) - 1);
  }
  // Of the first leaf pending.
  __device__ __forceinline__ Vec points_of(Index first, unsigned pending) const {
    return pending != 0 ? position_of(tree_.points[(first + first_of(pending)) * kLeafSize + lane_number()]) : Vec{};
  }
  // The leaves up to `beside` away that exist, as bits from leaf_ - beside on.
  __device__ __forceinline__ unsigned leaves_beside(Index beside) const {
    const LeafRange cloud = tree_.leaves_beside(leaf_);
    const Index behind = leaf_ - cloud.begin;
    const unsigned before = behind < beside ? beside - behind : 0u, after = min(cloud.end - 1 - leaf_, beside);
    return ((2u << (beside + after)) - 1u) & ~((1u << before) - 1u) & ~(1u << beside);
  }
  // Its own leaf and those beside it, as bits of a group of leaves.
  __device__ __forceinline__ unsigned seen_from(Index first_leaf, Index beside) const {
    const unsigned all = (2u << (2 * beside)) - 1u;
    const int shift = static_cast<int>(leaf_ - beside - first_leaf);
    if (shift >= 0) return shift < kWarp ? all << shift : 0u;
    return shift > -kWarp ? all >> -shift : 0u;
  }

  // Puts the points of the leaf that some lane may need at the end of `close`. Returns false if there are too many.
  __device__ __forceinline__ bool collect(Index leaf, Vec p) {
    const bool near = is_near({p, p});
    const unsigned all_near = __ballot_sync(kAllLanes, near);
    const unsigned count = static_cast<unsigned>(__popc(all_near));
    if (slots_ + count > GroupShape<kList, kWide>::kMostSlots - 1)
      return false;  // the last slot would look like an empty place
    if constexpr (kElsewhere)
      if (at_ / kLeafSize == leaf)
        own_slot_ = slots_ + static_cast<unsigned>(__popc(all_near & ((1u << at_ % kLeafSize) - 1)));
    if (near) {
      const unsigned rank = static_cast<unsigned>(__popc(all_near & lanes_below()));
      put(close_ + rank, scaled_of(p), slots_ + rank, leaf * kLeafSize + lane_number());
    }
    close_ += count;
    slots_ += count;
    return true;
  }

  // Offers the collected points to every lane. Each lane stacks those within its limit; the stacks are merged into the
  // lists when one of them could overflow, and at last if `rest`.
  __device__ __forceinline__ void look_at_close(bool rest) {
    if (lane_number() < kChunk) {
      memory_.close[close_ + lane_number()] = {};
      memory_.square[close_ + lane_number()] = kFar;
    }
    __syncwarp();
#pragma unroll 1
    for (unsigned start = 0; start < close_ || rest; start += kChunk) {
      if (start < close_) {
        float4 candidates[kChunk];
#pragma unroll
        for (unsigned i = 0; i < kChunk; ++i) candidates[i] = memory_.close[start + i];
        const float4 a = squares_from(start), b = squares_from(start + 4);
        const float squares[kChunk] = {a.x, a.y, a.z, a.w, b.x, b.y, b.z, b.w};
#pragma unroll
        for (unsigned i = 0; i < kChunk; ++i) stack_if_close(candidates[i], squares[i]);
      }
      const bool last = start + kChunk >= close_;
      const unsigned full = stack_ + (rest && last ? 0 : kStack - kChunk) * kEntry;
      while (__any_sync(kAllLanes, top_ > full)) merge_stack();
      if (last) break;
    }
    __syncwarp();
    close_ = 0;
  }

  __device__ __forceinline__ void stack_if_close(float4 candidate, float square) {
    const float distance = distance_to(candidate, square);
    if (!(distance <= limit_)) return;  // a lane without a point gets NaN
    if constexpr (kElsewhere)
      if (__float_as_uint(candidate.w) == own_slot_) return;
    store_word(top_, key_of(distance, candidate));
    top_ += kEntry;
  }

  __device__ __forceinline__ void merge_stack() {
    unsigned batch[kBatch];
#pragma unroll
    for (unsigned i = 0; i < kBatch; ++i) {
      batch[i] = ~0u;
      if (top_ > stack_ + i * kEntry) batch[i] = load_word(top_ - (i + 1) * kEntry);
    }
    top_ = max(top_, stack_ + kBatch * kEntry) - kBatch * kEntry;
    merge_batch(list_, batch, rejected_);
    update_limit();
  }

  // A candidate farther than this by kUnsure units cannot be among the k nearest.
  __device__ __forceinline__ void update_limit() {
    limit_ = fminf(limit_, kUnitsBase + float(units_of(list_[kList - 1]) + kUnsure));
    update_reach();
  }
  // A lane that looks much farther than the others would make all of them look at everything in between, so it is left
  // to the exact search. Beyond 6 times the mean, half as many queries end up there as without.
  __device__ __forceinline__ void drop_far_lanes() {
    const unsigned units = searches() ? static_cast<unsigned>(limit_ - no_distance_) : 0u;
    const unsigned lanes = static_cast<unsigned>(__popc(__ballot_sync(kAllLanes, searches())));
    const bool far = units * lanes > 6 * warp_sum(units);  // below 2^22 * 32 on either side
    dropped_at_ = limit_ - no_distance_;
    limit_ = far ? kNotSearching : limit_;
    any_dropped_ = __any_sync(kAllLanes, far);
    update_reach();
  }
  __device__ __forceinline__ bool searches() const { return limit_ > 0; }

  // A little too much, never too little.
  __device__ __forceinline__ float units_to_squared() const {
    return squared_diagonal_ * (1.001f / (kDiagonalSteps * kDiagonalSteps));
  }
  // What must come near to the boxes.
  __device__ __forceinline__ void update_reach() {
    boxes_.set_reach(
        searches() ? __float_as_uint(limit_ - no_distance_) : 0u,
        [](unsigned units, float factor) { return __uint_as_float(units) * factor; }, units_to_squared());
  }

  const Tree& tree_;
  GroupMemory<kList, kWide>& memory_;
  Index leaf_, at_;
  Vec position_;
  bool active_;
  QueryBoxes boxes_;
  Vec low_, half_;  // the middle as a sum: where floats are coarse, one alone may be a corner of the box
  Vec query_;       // -2 q
  float squared_diagonal_, scale_;
  bool any_dropped_ = false;     // lanes that looked too far
  float dropped_at_ = 0;         // how far this one looked, units
  bool limited_ = false;         // by the radius rather than by the range of keys
  float no_distance_;            // what distance_to() makes of none at all
  float limit_ = kNotSearching;  // as distance_to()
  unsigned list_[kList];         // sorted keys
  unsigned rejected_ = ~0u;      // the least key that was looked at and is not in the list
  unsigned close_ = 0, slots_ = 0;
  unsigned own_slot_ = 0;  // none is its own neighbour
  unsigned stack_, top_;   // addresses of this lane's stack and of its first free place
};

}  // namespace pointfair::cuda
