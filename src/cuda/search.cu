// SPDX-License-Identifier: Apache-2.0
#include "cuda/exact_group_search.cuh"
#include "cuda/group_search.cuh"
#include "cuda/launch.cuh"
#include "cuda/retries.cuh"
#include "cuda/search.cuh"
#include "cuda/single_search.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kSingleBlock = 64;
constexpr int kSingleBlocks = 24;       // of a processor
constexpr int kFewUncertain = 5;        // up to so many queries of a leaf go to the exact search one by one,
constexpr Index kManyCandidates = 256;  // or however many with so many candidates, which one warp would be long about;
constexpr int kMostUncertain = 16;      // of a hard leaf whose other lists are kept
constexpr Index kFewHardLeaves = 128;   // also the queries of so few leaves: a warp to a leaf would leave the card idle

constexpr int group_warps_resident(int list, bool wide) { return list <= 8 ? (wide ? 28 : 32) : list <= 16 ? 23 : 16; }
constexpr Index kManyLeaves = 1 << 19;  // clouds of so many tend to have noise that is wide against their spacing

// A block to a leaf, one warp.
template <int kList, bool kWide>
__global__ void __launch_bounds__(kWarp, resident_blocks(group_warps_resident(kList, kWide), kWarp))
    nearest_of_leaves(const __grid_constant__ Tree tree, CloudState* state, NearestQuery query, Index* lists,
                      Retries retries) {
  __shared__ GroupMemory<kList, kWide> memory;
  begin_kernel();
  const Index leaf = blockIdx.x, at = leaf * kLeafSize + lane_number();
  const Index valid = state->valid;
  if (leaf >= tree.leaves) return;
  Index* list = lists + std::size_t(leaf) * query.k * kLeafSize;
  if (at >= valid) {
    for (int slot = 0; slot < query.k; ++slot) list[slot * kWarp + lane_number()] = point::kNoNeighbor;
  }
  if (leaf * kLeafSize >= valid) return;
  GroupSearch<kList, kWide> search(tree, memory, leaf, valid);
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
  const Index count = tree.state->leaf_retries, valid = tree.state->valid;
  if (count < kFewHardLeaves) return;
  for (Index n = blockIdx.x; n < count; n += gridDim.x) {
    const Index leaf = retries[n].leaf;
    ExactGroupSearch<kList> search(tree, leaf, valid);
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
  search.run();
  list.for_each(
      query.k, [&](int slot, Key key, Index found) { out[slot * kWarp] = key != kNoKey ? found : point::kNoNeighbor; });
  __syncwarp();
}

__device__ Index* list_of(Index* lists, int k, Index at) {
  return lists + std::size_t(at / kWarp) * k * kWarp + at % kWarp;
}

// The queries that are left, a warp to each. A bound is in the first place of their lists.
__global__ void __launch_bounds__(kSingleBlock, resident_blocks(kSingleBlocks, kSingleBlock))
    nearest_of_left(const __grid_constant__ Tree tree, NearestQuery query, Index* lists, Retries retries) {
  __shared__ SingleWalk walks[kSingleBlock / kWarp];
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
    RegisterList list;
    search_single(tree, walks[warp], list, query, at, bound, out);
  }
}

extern __shared__ __align__(16) std::byte list_memory[];

// Lists too long for registers: all queries, a warp to each.
__global__ void nearest_of_all(const __grid_constant__ Tree tree, NearestQuery query, int size, Index* lists,
                               const __grid_constant__ Stop stop) {
  __shared__ SingleWalk walks[kSingleBlock / kWarp];
  const Index warps = gridDim.x * (blockDim.x / kWarp), warp = threadIdx.x / kWarp;
  for (Index at = blockIdx.x * (blockDim.x / kWarp) + warp; at < tree.state->valid; at += warps) {
    Index* out = list_of(lists, query.k, at);
    if (stop.is_heard(at)) {
      for (int slot = lane_number(); slot < query.k; slot += kWarp) out[slot * kWarp] = point::kNoNeighbor;
      continue;
    }
    SharedList list(list_memory + warp * SharedList::bytes(size), size);
    search_single(tree, walks[warp], list, query, at, __int_as_float(0x7f800000), out);
  }
}

// Places of the last leaves that hold no valid point, where no group search fills them.
__global__ void clear_lists_beyond(const CloudState* state, Index leaves, int k, Index* lists) {
  const std::size_t valid = state->valid, all = std::size_t(leaves) * kLeafSize;
  for (std::size_t at = valid + blockIdx.x * blockDim.x + threadIdx.x; at < all; at += gridDim.x * blockDim.x)
    for (int slot = 0; slot < k; ++slot) lists[(at / kWarp * k + slot) * kWarp + at % kWarp] = point::kNoNeighbor;
}

__global__ void sample(const __grid_constant__ Tree tree, const Point* points, const Index* queries, std::size_t count,
                       int k, int size, Point* rows) {
  __shared__ SingleWalk walk;
  const float nan = __int_as_float(0x7fc00000);
  for (std::size_t n = blockIdx.x; n < count; n += gridDim.x) {
    const Point p = points[queries[n]];
    Point* row = rows + n * (std::size_t(k) + 1);
    const bool valid = point::is_indexable(p.x, p.y, p.z);
    SharedList list(list_memory, size);
    if (valid)
      SingleSearch<SharedList>(tree, walk, list, {p.x, p.y, p.z}, queries[n], k, __int_as_float(0x7f800000)).run();
    list.for_each(k, [&](int slot, Key key, Index found) {
      const float4 q = key != kNoKey ? tree.points[found] : float4{nan, nan, nan, 0};
      row[slot + 1] = {q.x, q.y, q.z};
    });
    if (lane_number() == 0) row[0] = valid ? p : Point{nan, nan, nan};
    __syncwarp();
  }
}

template <int kList, bool kWide>
void search_leaves(Context& context, const Tree& tree, CloudState* state, NearestQuery query, Index* list,
                   Retries retries) {
  const unsigned blocks = blocks_for(tree.leaves, 1), processors = unsigned(context.processors());
  launch_early(context, "searching neighbours", nearest_of_leaves<kList, kWide>, blocks, kWarp, tree, state, query,
               list, retries);
  launch_early(context, "searching neighbours of hard leaves", nearest_of_hard_leaves<kList>,
               std::min(blocks, processors * 24), kWarp, tree, query, list, retries.leaves);
  launch_early(context, "searching neighbours left over", nearest_of_left, processors * kSingleBlocks, kSingleBlock,
               tree, query, list, retries);
}

void search_all(Context& context, const Tree& tree, CloudState* state, NearestQuery query, Index* list,
                const Stop& stop) {
  const cudaStream_t stream = context.stream();
  clear_lists_beyond<<<context.processors(), 256, 0, stream>>>(state, tree.leaves, query.k, list);
  check(cudaGetLastError(), "preparing the search");
  const int size = SharedList::size_for(query.k), warps = size <= 256 ? kSingleBlock / kWarp : 1;
  const std::size_t bytes = allow_list_memory(nearest_of_all, warps, size);
  nearest_of_all<<<unsigned(context.processors()) * 16, warps * kWarp, bytes, stream>>>(tree, query, size, list, stop);
  check(cudaGetLastError(), "searching neighbours");
}

}  // namespace

void find_nearest(Context& context, const Tree& tree, CloudState* state, NearestQuery query, Index* list,
                  Retries retries, const Stop& stop) {
  if (query.k > kLargestGroupList) return search_all(context, tree, state, query, list, stop);
  const auto search = query.k > 16                 ? search_leaves<32, false>
                      : query.k > 8                ? search_leaves<16, false>
                      : tree.leaves >= kManyLeaves ? search_leaves<8, true>
                                                   : search_leaves<8, false>;
  search(context, tree, state, query, list, retries);
}

void sample_nearest(Context& context, const Tree& tree, const Point* points, const Index* queries, std::size_t count,
                    int k, Point* rows) {
  const int size = SharedList::size_for(k);
  const std::size_t bytes = allow_list_memory(sample, 1, size);
  const unsigned blocks = std::min(blocks_for(count, 1), unsigned(context.processors()) * 16);
  sample<<<blocks, kWarp, bytes, context.stream()>>>(tree, points, queries, count, k, size, rows);
  check(cudaGetLastError(), "sampling neighbourhoods");
}

}  // namespace pointfair::cuda
