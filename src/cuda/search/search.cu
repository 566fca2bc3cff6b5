// SPDX-License-Identifier: Apache-2.0
#include "cuda/runtime/launch.cuh"
#include "cuda/search/exact_group_search.cuh"
#include "cuda/search/group_search.cuh"
#include "cuda/search/retries.cuh"
#include "cuda/search/search.cuh"
#include "cuda/search/single_search.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kSingleBlock = 64;
constexpr int kSingleBlocks = 24;       // of a processor
constexpr int kFewUncertain = 5;        // up to so many queries of a leaf go to the exact search one by one,
constexpr Index kManyCandidates = 256;  // or however many with so many candidates, which one warp would be long about;
constexpr int kMostUncertain = 16;      // of a hard leaf whose other lists are kept
constexpr Index kFewHardLeaves = 128;   // also the queries of so few leaves: a warp to a leaf would leave the card idle

struct None {};

constexpr int group_warps_resident(int list, bool wide) {
  return list <= 8 ? (wide ? 28 : 32) : list <= 16 ? 23 : list <= 32 ? 16 : 11;
}
constexpr Index kManyLeaves = 1 << 19;  // clouds of so many tend to have noise that is wide against their spacing

// Whether a point of `later` may belong into a list of the leaf: whether one lies within reach of the leaf's boxes.
__device__ bool may_have_nearer(const Tree& tree, const Tree& later, Index leaf, NearestQuery query,
                                const Index* list) {
  const float4 p = tree.points[leaf * kLeafSize + lane_number()];
  QueryBoxes boxes(position_of(p), is_present(p));
  const Index last = is_present(p) ? list[(query.k - 1) * kWarp + lane_number()] : point::kNoNeighbor;
  float reach = query.squared_limit;
  if (last != point::kNoNeighbor) reach = point::squared_length(position_of(tree.points[last]) - position_of(p));
  boxes.set_reach(
      is_present(p) ? __float_as_uint(reach) : 0u, [](unsigned bits, float) { return __uint_as_float(bits); }, 0.0f);
  Walk walk(later, 0);
  const auto near = [&](const BoxGroup& group) {
    const Box box = box_of_lane(group);
    const float gap = squared_gap(box, boxes.box[0]);
    bool is_near = gap <= boxes.reach[0] && gap < __int_as_float(0x7f800000);
    if (boxes.split) {
      const float other = squared_gap(box, boxes.box[1]);
      is_near = is_near || (other <= boxes.reach[1] && other < __int_as_float(0x7f800000));
    }
    return is_near;
  };
  return walk.next(near) != point::kNoNeighbor;
}

// A block to a leaf, one warp. With kAgain only where `later` matters.
template <int kList, bool kWide, bool kAgain>
__global__ void __launch_bounds__(kWarp, resident_blocks(group_warps_resident(kList, kWide), kWarp))
    nearest_of_leaves(const __grid_constant__ Tree tree,
                      const __grid_constant__ std::conditional_t<kAgain, Tree, None> later, CloudState* state,
                      LeafRange leaves, NearestQuery query, Index* lists, Retries retries) {
  __shared__ GroupMemory<kList, kWide> memory;
  begin_kernel();
  const Index leaf = leaves.begin + blockIdx.x, at = leaf * kLeafSize + lane_number();
  if (leaf >= leaves.end) return;
  Index* list = lists + std::size_t(leaf) * query.k * kLeafSize;
  if constexpr (kAgain) {
    if (!may_have_nearer(tree, later, leaf, query, list)) return;
  }
  GroupSearch<kList, kWide> search(tree, memory, leaf);
  if (!search.active()) {
    for (int slot = 0; slot < query.k; ++slot) list[slot * kWarp + lane_number()] = point::kNoNeighbor;
  }
  if (!__any_sync(kAllLanes, search.active())) return;
  bool found = false, is_hard = search.in_one_place();
  float bound = __int_as_float(0x7f800000);
  const bool suits = search.suits(), complete = suits && search.run(query.k, query.squared_limit);
  if (suits) bound = search.bound();
  if (complete) {
    found = search.certain();
    const int uncertain = __popc(__ballot_sync(kAllLanes, !found));
    is_hard = uncertain > kFewUncertain && search.candidates() < kManyCandidates && !search.any_dropped();
    found = found && !(is_hard && uncertain > kMostUncertain);
    if (__any_sync(kAllLanes, found)) search.write(query.k, query.squared_limit, list, found);
  }
  const bool left = search.active() && !found;
  if (left) list[lane_number()] = __float_as_uint(bound);  // until there is something better
  const unsigned undecided = __ballot_sync(kAllLanes, left);
  if (is_hard) return retry_leaf(state, retries.leaves, {leaf, undecided});
  retry(state, retries.queries, at, left);
}

template <int kList>
__global__ void __launch_bounds__(kWarp) nearest_of_hard_leaves(const __grid_constant__ Tree tree, NearestQuery query,
                                                                Index* lists, const HardLeaf* retries) {
  begin_kernel();
  const Index count = tree.state->leaf_retries;
  if (count < kFewHardLeaves) return;
  for (Index n = blockIdx.x; n < count; n += gridDim.x) {
    const Index leaf = retries[n].leaf;
    ExactGroupSearch<kList> search(tree, leaf);
    search.run(query.k, query.squared_limit);
    search.write(query.k, lists + std::size_t(leaf) * query.k * kLeafSize);
  }
}

// `bound`: as SingleSearch::bound().
template <class List>
__device__ void search_single(const Tree& tree, SingleWalk& walk, List& list, NearestQuery query, Index at, float bound,
                              Index* out) {
  const float4 p = tree.points[at];
  SingleSearch<List> search(tree, walk, list, position_of(p), original_of(p), query.k, query.squared_limit);
  search.bound(bound);
  search.run(tree.root_over(at / kLeafSize));
  list.for_each(query.k, [&](int slot, Key key) { out[slot * kWarp] = point::key_index(key); });
  __syncwarp();
}

__device__ Index* list_of(Index* lists, int k, Index at) {
  return lists + std::size_t(at / kWarp) * k * kWarp + at % kWarp;
}

// The queries that are left, a warp to each. A bound is in the first place of their lists. kLong: lists too long for
// registers.
template <bool kLong>
__global__ void __launch_bounds__(kSingleBlock, resident_blocks(kSingleBlocks, kSingleBlock))
    nearest_of_left(const __grid_constant__ Tree tree, NearestQuery query, Index* lists, Retries retries) {
  __shared__ SingleWalk walks[kSingleBlock / kWarp];
  __shared__ __align__(16)
      std::byte long_lists[kLong ? kSingleBlock / kWarp * SharedList::bytes(kLargestGroupList) : 16];
  begin_kernel();
  const Index warps = gridDim.x * (kSingleBlock / kWarp), warp = threadIdx.x / kWarp;
  const Index queries = tree.state->retries, hard_leaves = tree.state->leaf_retries;
  const Index count = queries + (hard_leaves < kFewHardLeaves ? hard_leaves * kLeafSize : 0);
  for (Index n = blockIdx.x * (kSingleBlock / kWarp) + warp; n < count; n += warps) {
    Index at;
    if (n < queries) {
      at = retries.queries[n];
    } else {
      const HardLeaf hard = retries.leaves[(n - queries) / kLeafSize];
      const Index lane = (n - queries) % kLeafSize;
      if ((hard.undecided >> lane & 1u) == 0) continue;
      at = hard.leaf * kLeafSize + lane;
    }
    Index* out = list_of(lists, query.k, at);
    const float bound = __uint_as_float(*out);
    __syncwarp();  // all lanes have read it
    if constexpr (kLong) {
      std::byte* const memory = long_lists + warp * SharedList::bytes(kLargestGroupList);
      SharedList list(tree.points, memory, kLargestGroupList);
      search_single(tree, walks[warp], list, query, at, bound, out);
    } else {
      RegisterList list(tree.points);
      search_single(tree, walks[warp], list, query, at, bound, out);
    }
  }
}

extern __shared__ __align__(16) std::byte list_memory[];

// Lists too long for the search of leaves: all queries, a warp to each.
__global__ void nearest_of_all(const __grid_constant__ Tree tree, NearestQuery query, int size, Index* lists,
                               const __grid_constant__ Stop stop) {
  __shared__ SingleWalk walks[kSingleBlock / kWarp];
  const Index warps = gridDim.x * (blockDim.x / kWarp), warp = threadIdx.x / kWarp;
  for (Index at = blockIdx.x * (blockDim.x / kWarp) + warp; at < tree.leaves * kLeafSize; at += warps) {
    if (!tree.holds(at)) continue;
    Index* out = list_of(lists, query.k, at);
    if (stop.is_heard(at)) {
      for (int slot = lane_number(); slot < query.k; slot += kWarp) out[slot * kWarp] = point::kNoNeighbor;
      continue;
    }
    SharedList list(tree.points, list_memory + warp * SharedList::bytes(size), size);
    search_single(tree, walks[warp], list, query, at, __int_as_float(0x7f800000), out);
  }
}

// Places that hold no valid point, where no group search fills them.
__global__ void clear_lists_of_none(const __grid_constant__ Tree tree, int k, Index* lists) {
  const std::size_t all = std::size_t(tree.leaves) * kLeafSize;
  for (std::size_t at = blockIdx.x * blockDim.x + threadIdx.x; at < all; at += gridDim.x * blockDim.x)
    for (int slot = 0; slot < k && !tree.holds(at); ++slot)
      lists[(at / kWarp * k + slot) * kWarp + at % kWarp] = point::kNoNeighbor;
}

// With `later` as find_nearest_again().
template <int kList, bool kWide>
void search_leaves(Context& context, const Tree& tree, const Tree* later, CloudState* state, LeafRange leaves,
                   NearestQuery query, Index* list, Retries retries) {
  const unsigned blocks = blocks_for(leaves.count(), 1);
  if (later != nullptr) {
    launch_early(context, "searching neighbours", nearest_of_leaves<kList, kWide, true>, blocks, kWarp, tree, *later,
                 state, leaves, query, list, retries);
  } else {
    launch_early(context, "searching neighbours", nearest_of_leaves<kList, kWide, false>, blocks, kWarp, tree, None{},
                 state, leaves, query, list, retries);
  }
}

template <int kList>
void search_left(Context& context, const Tree& tree, LeafRange leaves, NearestQuery query, Index* list,
                 Retries retries) {
  const unsigned blocks = blocks_for(leaves.count(), 1), processors = unsigned(context.processors());
  // Both only need what the leaves have left. The second mostly has nothing to do, and comes while the first ends.
  launch_early(context, "searching neighbours left over", nearest_of_left<(kList > RegisterList::kCapacity)>,
               processors * kSingleBlocks, kSingleBlock, tree, query, list, retries);
  launch_early(context, "searching neighbours of hard leaves", nearest_of_hard_leaves<kList>,
               std::min(blocks, processors * 24), kWarp, tree, query, list, retries.leaves);
}

void search_all(Context& context, const Tree& tree, NearestQuery query, Index* list, const Stop& stop) {
  const cudaStream_t stream = context.stream();
  launch(context, "preparing the search", clear_lists_of_none, context.processors() * 8, 256, tree, query.k, list);
  const int size = SharedList::size_for(query.k), warps = size <= 256 ? kSingleBlock / kWarp : 1;
  const std::size_t bytes = allow_list_memory(nearest_of_all, warps, size);
  nearest_of_all<<<unsigned(context.processors()) * 16, warps * kWarp, bytes, stream>>>(tree, query, size, list, stop);
  check(cudaGetLastError(), "searching neighbours");
}

auto search_for(int k, Index leaves) {
  return k > 32                  ? search_leaves<64, false>
         : k > 16                ? search_leaves<32, false>
         : k > 8                 ? search_leaves<16, false>
         : leaves >= kManyLeaves ? search_leaves<8, true>
                                 : search_leaves<8, false>;
}

}  // namespace

void find_nearest(Context& context, const Tree& tree, CloudState* state, NearestQuery query, Index* list,
                  Retries retries, const Stop& stop) {
  if (query.k > kLargestGroupList) return search_all(context, tree, query, list, stop);
  const LeafRange all{0, tree.leaves};
  find_nearest_of(context, tree, state, all, query, list, retries);
  find_nearest_of_left(context, tree, all, query, list, retries);
}

void find_nearest_of(Context& context, const Tree& tree, CloudState* state, LeafRange leaves, NearestQuery query,
                     Index* list, Retries retries) {
  search_for(query.k, tree.leaves)(context, tree, nullptr, state, leaves, query, list, retries);
}

void find_nearest_again(Context& context, const Tree& tree, const Tree& later, CloudState* state, LeafRange leaves,
                        NearestQuery query, Index* list, Retries retries) {
  search_for(query.k, tree.leaves)(context, tree, &later, state, leaves, query, list, retries);
}

void find_nearest_of_left(Context& context, const Tree& tree, LeafRange leaves, NearestQuery query, Index* list,
                          Retries retries) {
  const auto search = query.k > 32   ? search_left<64>
                      : query.k > 16 ? search_left<32>
                      : query.k > 8  ? search_left<16>
                                     : search_left<8>;
  search(context, tree, leaves, query, list, retries);
}

}  // namespace pointfair::cuda
