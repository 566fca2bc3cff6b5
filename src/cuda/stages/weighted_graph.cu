// SPDX-License-Identifier: Apache-2.0
// Entries of all rows are sorted as keys, the row over the neighbour. An edge that both ends list is there twice.
#include <bit>
#include <cub/device/device_radix_sort.cuh>

#include "cuda/runtime/transfer.cuh"
#include "cuda/stages/ordered_sum.cuh"
#include "cuda/stages/weighted_graph.cuh"
#include "seam/rules.hpp"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 256;

using EntryKey = unsigned long long;
using point::GraphEntry;

constexpr float kHalf = 0.5f;  // of an edge, from each end that lists the other

struct KeyShape {
  int bits;
  __host__ __device__ EntryKey absent() const { return (EntryKey(1) << (2 * bits)) - 1; }  // behind all others
  __device__ EntryKey of(Index row, Index there) const { return (EntryKey(row) << bits) | there; }
  __device__ EntryKey row_begin(std::size_t row) const { return EntryKey(row) << bits; }
  __device__ Index row(EntryKey key) const { return static_cast<Index>(key >> bits); }
  __device__ Index there(EntryKey key) const { return static_cast<Index>(key & ((EntryKey(1) << bits) - 1)); }
};

__global__ void __launch_bounds__(kBlock)
    list_keys(const __grid_constant__ Tree tree, Lists lists, KeyShape shape, EntryKey* keys) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x, places = std::size_t(tree.leaves) * kLeafSize;
  if (at >= places) return;
  const Index* const list = lists.of(at);
  const bool valid = tree.holds(at);
  const auto are_at_one_place = [&](Index i, Index j) {
    const float4 p = tree.points[i], q = tree.points[j];
    return p.x == q.x && p.y == q.y && p.z == q.z;
  };
  for (int slot = 0; slot < lists.k; ++slot) {
    const bool exists = valid && list[slot * kWarp] != point::kNoNeighbor;
    const Index there = exists ? point::first_alike([&](int s) { return list[s * kWarp]; }, slot,
                                                    static_cast<Index>(at), are_at_one_place)
                               : point::kNoNeighbor;
    const std::size_t to = std::size_t(list - lists.list) + std::size_t(slot) * kWarp;
    keys[to] = exists ? shape.of(static_cast<Index>(at), there) : shape.absent();
    keys[places * lists.k + to] = exists ? shape.of(there, static_cast<Index>(at)) : shape.absent();
  }
}

// The first of the sorted keys of each row, and of one row more.
__global__ void __launch_bounds__(kBlock)
    find_rows(const EntryKey* keys, std::size_t count, KeyShape shape, std::size_t places, EntryKey* begin) {
  const std::size_t row = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (row > places) return;
  std::size_t low = 0, high = count;
  while (low < high) {
    const std::size_t middle = low + (high - low) / 2;
    if (keys[middle] < shape.row_begin(row)) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  begin[row] = low;
}

__global__ void __launch_bounds__(kBlock) merge_rows(const EntryKey* keys, KeyShape shape, std::size_t places,
                                                     const EntryKey* begin, GraphEntry* entries, Index* count) {
  const std::size_t row = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (row >= places) return;
  for (std::size_t n = begin[row]; n < begin[row + 1]; ++n) entries[n] = {shape.there(keys[n]), kHalf};
  count[row] = point::merge_entries(entries + begin[row], static_cast<Index>(begin[row + 1] - begin[row]));
}

// Sums of lengths and numbers of edges, of each block of the sum.
__global__ void __launch_bounds__(kSumThreads)
    sum_lengths(const __grid_constant__ Tree tree, const EntryKey* keys, KeyShape shape, const EntryKey* begin,
                std::size_t places, double* sums) {
  const SumRange rows(places);
  const double sum = sum_in_order<2>(begin[rows.first], begin[rows.end], [&](std::size_t n, double* numbers) {
    const EntryKey key = keys[n];
    if (n > 0 && keys[n - 1] == key) return;
    numbers[0] = point::edge_length(place_of(tree.points[shape.row(key)]), place_of(tree.points[shape.there(key)]));
    numbers[1] = 1;
  });
  if (threadIdx.x < 2) sums[std::size_t(blockIdx.x) * 2 + threadIdx.x] = sum;
}

__global__ void __launch_bounds__(kSumThreads) add_lengths(const double* sums, std::size_t blocks, double* mean) {
  const Totals<2> all(sums, blocks);
  if (threadIdx.x == 0) *mean = all.of[1] > 0 ? all.of[0] / all.of[1] : 0;
}

__global__ void __launch_bounds__(kBlock)
    weigh_rows(const __grid_constant__ Tree tree, std::size_t places, point::EdgeRule rule, const EntryKey* begin,
               const Index* count, GraphEntry* entries, double* mass, double* weight_sum) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (at >= places) return;
  GraphEntry* const row = entries + begin[at];
  const double its = point::weigh_row(row, count[at], place_of(tree.points[at]), rule,
                                      [&](Index there) { return place_of(tree.points[there]); });
  weight_sum[at] = point::sum_of_row(row, count[at]);
  mass[at] = count[at] < Index(point::kLeastNeighbors) ? 0 : its;
}

}  // namespace

WeightedGraph::WeightedGraph(Context& context, const Tree& tree, const Lists& lists, const FairingSettings& settings)
    : context_(context),
      places_(std::size_t(tree.leaves) * kLeafSize),
      bits_(std::bit_width(places_)),
      begin_(context),
      count_(context),
      entries_(context),
      mass_(context),
      weight_sum_(context) {
  Keys keys(context);
  sort_entries(tree, lists, keys);
  begin_.resize(places_ + 1);
  count_.resize(places_);
  mass_.resize(places_);
  weight_sum_.resize(places_);
  const KeyShape shape{bits_};
  const unsigned blocks = blocks_for(places_, kBlock);
  const cudaStream_t stream = context.stream();
  GraphEntry* const entries = reinterpret_cast<GraphEntry*>(entries_.data());
  find_rows<<<blocks_for(places_ + 1, kBlock), kBlock, 0, stream>>>(keys.data(), keys.size(), shape, places_,
                                                                    begin_.data());
  launch(context, "joining neighbours", merge_rows, blocks, kBlock, keys.data(), shape, places_, begin_.data(), entries,
         count_.data());
  const double length = settings.implicit_weights == ImplicitWeights::scale ? mean_length(tree, keys) : 0;
  launch(context, "weighing edges", weigh_rows, blocks, kBlock, tree, places_, edge_rule(settings, length),
         begin_.data(), count_.data(), entries, mass_.data(), weight_sum_.data());
  lambda_unit_ = pointfair::lambda_unit(settings, length);
}

void WeightedGraph::sort_entries(const Tree& tree, const Lists& lists, Keys& keys) {
  const std::size_t count = 2 * places_ * std::size_t(lists.k);
  keys.resize(count);
  entries_.resize(count);
  list_keys<<<blocks_for(places_, kBlock), kBlock, 0, context_.stream()>>>(tree, lists, {bits_}, keys.data());
  check(cudaGetLastError(), "joining neighbours");
  cub::DoubleBuffer<EntryKey> buffers(keys.data(), entries_.data());
  with_scratch(context_, "sorting neighbours", [&](void* scratch, std::size_t& bytes) {
    return cub::DeviceRadixSort::SortKeys(scratch, bytes, buffers, count, 0, 2 * bits_, context_.stream());
  });
  if (buffers.Current() != keys.data()) keys.swap(entries_);
}

double WeightedGraph::mean_length(const Tree& tree, const Keys& keys) {
  const std::size_t blocks = blocks_for(places_, point::kSumBlock);
  DeviceArray<double> sums(context_);
  sums.resize(2 * blocks + 1);
  double* const mean = sums.data() + 2 * blocks;
  sum_lengths<<<static_cast<unsigned>(blocks), kSumThreads, 0, context_.stream()>>>(
      tree, keys.data(), {bits_}, begin_.data(), places_, sums.data());
  launch(context_, "measuring edges", add_lengths, 1, kSumThreads, sums.data(), blocks, mean);
  Pinned<double> result;
  check(cudaMemcpyAsync(result.get(), mean, sizeof(double), cudaMemcpyDeviceToHost, context_.stream()),
        "measuring edges");
  check(cudaStreamSynchronize(context_.stream()), "measuring edges");
  return *result.get();
}

}  // namespace pointfair::cuda
