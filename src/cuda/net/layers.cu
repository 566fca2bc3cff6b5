// SPDX-License-Identifier: Apache-2.0
// A block of three warps works on a leaf. Matrices are for the tensor cores: a warp has 16 channels of all points. Of
// edges a thread has four channels of four points, so that their mean and maximum stay in the thread.
#include "cuda/net/layers.cuh"
#include "cuda/runtime/warp.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 128;
constexpr int kPointsOfThread = 4, kGroups = kWarp / kPointsOfThread;  // threads with the same channels
constexpr int kWords = net::kChannelWords, kTile = kWords * kGroups;
constexpr int kQuads = kWords / 4;  // loads of 16 bytes for a state
// words; no conflicts of banks
constexpr int kHiddenRow = net::kNeighbors * kWords + 4, kGateRow = kWarp + 1, kOwnRow = net::kChannels + 4;
static_assert(kTile == 3 * kWarp && kWords % net::kGates == 0 && kWords / net::kGates * 4 == net::kNeighbors);

__device__ __forceinline__ int clamped(int value, int least, int most) { return max(least, min(most, value)); }
__device__ __forceinline__ int activation(int rounded_sum) { return clamped(rounded_sum >> net::kSumShift, 0, 127); }
constexpr int kRounding = 1 << (net::kSumShift - 1);

__device__ __forceinline__ unsigned packed(int a, int b, int c, int d) {
  return static_cast<unsigned>(net::word_of(a, b, c, d));
}
__device__ __forceinline__ const int4* words_of(const signed char* weights) {
  return reinterpret_cast<const int4*>(weights);
}
__device__ __forceinline__ int4 bias_of(const int* bias, int word) { return reinterpret_cast<const int4*>(bias)[word]; }

__device__ __forceinline__ void add_word(int (&sums)[4], int input, int4 weights) {
  sums[0] = __dp4a(input, weights.x, sums[0]);
  sums[1] = __dp4a(input, weights.y, sums[1]);
  sums[2] = __dp4a(input, weights.z, sums[2]);
  sums[3] = __dp4a(input, weights.w, sums[3]);
}

// sums += a matrix of 16 x 16 bytes times one of 16 x 8, as the lanes of a warp hold them (PTX ISA, mma.m16n8k16).
__device__ __forceinline__ void multiply(int (&sums)[4], unsigned low_rows, unsigned high_rows, int weights) {
#if __CUDA_ARCH__ >= 800
  asm("mma.sync.aligned.m16n8k16.row.col.s32.s8.s8.s32 {%0,%1,%2,%3}, {%4,%5}, {%6}, {%0,%1,%2,%3};"
      : "+r"(sums[0]), "+r"(sums[1]), "+r"(sums[2]), "+r"(sums[3])
      : "r"(low_rows), "r"(high_rows), "r"(weights));
#else
  asm("mma.sync.aligned.m8n8k16.row.col.s32.s8.s8.s32 {%0,%1}, {%2}, {%3}, {%0,%1};"
      : "+r"(sums[0]), "+r"(sums[1])
      : "r"(low_rows), "r"(weights));
  asm("mma.sync.aligned.m8n8k16.row.col.s32.s8.s8.s32 {%0,%1}, {%2}, {%3}, {%0,%1};"
      : "+r"(sums[2]), "+r"(sums[3])
      : "r"(high_rows), "r"(weights));
#endif
}

// A warp's sums: 16 channels of the 32 points of a leaf.
class WarpSums {
 public:
  // From `bias`, null for 0, with the rounding of what comes after.
  __device__ __forceinline__ WarpSums(const int* bias, int rounding) {
    for_pairs([&](int, int channel, int& first, int& second) {
      first = (bias != nullptr ? bias[channel] : 0) + rounding;
      second = (bias != nullptr ? bias[channel + 1] : 0) + rounding;
    });
  }
  // Adds weights x inputs; `row(point)` has the inputs of a point, kLength words.
  template <int kLength, class Row>
  __device__ __forceinline__ void add_products(const signed char* weights, const Row& row) {
    const int* const its = reinterpret_cast<const int*>(weights) + lane_ % 4 * net::kChannels + first_ + lane_ / 4;
#pragma unroll
    for (int word = 0; word < kLength; word += 4) {
      const int near = its[word * net::kChannels], far = its[word * net::kChannels + 8];
#pragma unroll
      for (int half = 0; half < 2; ++half) {
        const unsigned low = row(16 * half + lane_ / 4)[word + lane_ % 4];
        const unsigned high = row(16 * half + 8 + lane_ / 4)[word + lane_ % 4];
        multiply(sums_[half][0], low, high, near);
        multiply(sums_[half][1], low, high, far);
      }
    }
  }
  // Calls visit(point, channel, its sum, that of the next channel) for all that this lane holds.
  template <class Visit>
  __device__ __forceinline__ void for_pairs(const Visit& visit) {
#pragma unroll
    for (int half = 0; half < 2; ++half)
#pragma unroll
      for (int n = 0; n < 2; ++n)
#pragma unroll
        for (int row = 0; row < 2; ++row)
          visit(16 * half + 8 * row + lane_ / 4, first_ + 8 * n + lane_ % 4 * 2, sums_[half][n][2 * row],
                sums_[half][n][2 * row + 1]);
  }

 private:
  int lane_ = static_cast<int>(lane_number()), first_ = static_cast<int>(threadIdx.x) / kWarp * 16;  // channel
  int sums_[2][2][4];
};

// A point a thread, as the next.
__global__ void __launch_bounds__(kBlock)
    measure_points(const __grid_constant__ NetCloud cloud, int scale, const Index* list) {
  const Index at = blockIdx.x * kBlock + threadIdx.x;
  if (at >= cloud.places) return;
  const net::Place here = cloud.place(at, cloud.given_normal);
  net::ScaleSums sums;
#pragma unroll 4
  for (int e = 0; e < net::kNeighbors; ++e) {
    const net::Edge<float> edge = net::edge_to(here, cloud.neighbor(NetCloud::listed(list, at, e), cloud.given_normal));
    sums.offset = sums.offset + edge.offset;
    sums.square = sums.square + edge.square;
    sums.height = sums.height + edge.height;
    sums.squared_height = sums.squared_height + edge.height * edge.height;
    sums.sine = sums.sine + edge.sine;
  }
  const net::Scale measured = net::scale_of(sums);
  cloud.scale[scale][at] = measured;
  cloud.size[scale][at] = measured.size;
}

__global__ void __launch_bounds__(kBlock)
    begin_points(const __grid_constant__ NetCloud cloud, const __grid_constant__ net::Weights weights) {
  const Index at = blockIdx.x * kBlock + threadIdx.x;
  if (at >= cloud.places) return;
  net::Place here = cloud.place(at, cloud.given_normal);
  net::Scale scales[net::kScales];
#pragma unroll
  for (int s = 0; s < net::kScales; ++s) scales[s] = cloud.scale[s][at];
  const net::Sides sides = net::sides_of(here.normal, scales[1].offset);
  const bool is_turned = point::dot(scales[1].offset, here.normal) < 0;
#pragma unroll
  for (int s = 0; s < net::kScales; ++s) scales[s].height = is_turned ? -scales[s].height : scales[s].height;
  here.normal = sides.up;
  cloud.normal[at] = {sides.up.x, sides.up.y, sides.up.z, here.measured.x};
  cloud.side[at] = sides.side;
  int inputs[net::kPointWords];
  net::point_words(here, scales, inputs);
  for (int word = 0; word < kWords; ++word) {
    const int4 bias = bias_of(weights.input_bias, word);
    int sums[4] = {bias.x + kRounding, bias.y + kRounding, bias.z + kRounding, bias.w + kRounding};
#pragma unroll
    for (int w = 0; w < net::kPointWords; ++w) add_word(sums, inputs[w], words_of(weights.input)[w * kWords + word]);
    cloud.state[std::size_t(at) * kWords + word] =
        packed(activation(sums[0]), activation(sums[1]), activation(sums[2]), activation(sums[3]));
  }
}

// Which channels and points a thread of a block has.
struct Tile {
  int word = static_cast<int>(threadIdx.x) % kWords, group = static_cast<int>(threadIdx.x) / kWords;
  Index first = blockIdx.x * kWarp;
  __device__ int lane_of(int p) const { return group * kPointsOfThread + p; }
};

__device__ __forceinline__ unsigned stored_pair(int a, int b) {
  constexpr int kHalf = 1 << (net::kStoredShift - 1);
  const int x = clamped((a + kHalf) >> net::kStoredShift, -32768, 32767);
  const int y = clamped((b + kHalf) >> net::kStoredShift, -32768, 32767);
  return (static_cast<unsigned>(x) & 0xffffu) | static_cast<unsigned>(y) << 16;
}

__device__ __forceinline__ unsigned activation_pair(int a, int b) {
  return static_cast<unsigned>(activation(a)) | static_cast<unsigned>(activation(b)) << 8;
}

__global__ void __launch_bounds__(kTile)
    store_states(const __grid_constant__ NetCloud cloud, const signed char* weights) {
  const std::size_t first = std::size_t(blockIdx.x) * kWarp;
  WarpSums sums(nullptr, 0);
  sums.add_products<kWords>(weights, [&](int p) { return cloud.state + (first + p) * kWords; });
  unsigned* const stored = reinterpret_cast<unsigned*>(cloud.stored);  // pairs of channels
  sums.for_pairs([&](int p, int channel, int a, int b) {
    stored[((first + p) * net::kChannels + channel) / 2] = stored_pair(a, b);
  });
}

struct None {};
struct Gated {
  union {
    unsigned hidden[kGroups * kHiddenRow];  // of one point of each group, edge by edge
    float terms[3][net::kNeighbors][kWarp];
  };
  float gates[net::kNeighbors * net::kGates * kGateRow];
};
template <bool kGated>
struct LayerMemory {
  int4 edges[net::kNeighbors][kWarp];  // words of features, and the neighbour
  unsigned means[kWarp][kWords], largest[kWarp][kWords];
  alignas(16) int own[kWarp][kOwnRow];
  std::conditional_t<kGated, Gated, None> gated;
};

// The weights of the edges for a thread's channels.
struct EdgeWeights {
  int4 of[net::kEdgeWords];
};

// What a neighbour stored, 8 times, and the edge's features on top of the point's own sum.
__device__ __forceinline__ void edge_activations(const int (&own)[4], uint2 stored, int4 edge,
                                                 const EdgeWeights& weights, int (&out)[4]) {
  constexpr int kLow = 1 << net::kStoredShift, kHigh = kLow << 8;  // as bytes, of which dp2a takes the lower two
  out[0] = __dp2a_lo(static_cast<int>(stored.x), kLow, own[0]);
  out[1] = __dp2a_lo(static_cast<int>(stored.x), kHigh, own[1]);
  out[2] = __dp2a_lo(static_cast<int>(stored.y), kLow, own[2]);
  out[3] = __dp2a_lo(static_cast<int>(stored.y), kHigh, own[3]);
  add_word(out, edge.x, weights.of[0]);
  add_word(out, edge.y, weights.of[1]);
  add_word(out, edge.z, weights.of[2]);
#pragma unroll
  for (int c = 0; c < 4; ++c) out[c] = activation(out[c]);
}

// A thread's edges are those of one lane's point: every third of them, by its warp.
template <class Visit>
__device__ __forceinline__ void for_edges(const Visit& visit) {
#pragma unroll 1
  for (int e = static_cast<int>(threadIdx.x) / kWarp; e < net::kNeighbors; e += kTile / kWarp) visit(e);
}

__device__ __forceinline__ void find_features(const NetCloud& cloud, int scale, const Index* list,
                                              const net::Place& here, Index at, int4 (&edges)[net::kNeighbors][kWarp]) {
  const Vec side = cloud.side[at];
  const float size = cloud.size[scale][at];
  for_edges([&](int e) {
    const Index its = NetCloud::listed(list, at, e);
    const net::Neighbor<float> there = cloud.neighbor(its, cloud.normal);
    int words[net::kEdgeWords];
    net::edge_words(here, side, size, there, net::edge_to(here, there), words);
    edges[e][lane_number()] = {words[0], words[1], words[2], static_cast<int>(its)};
  });
}

// Of one point of each group: the products of its edges with the gates.
__device__ __forceinline__ void find_gates(const signed char* weights, const Tile& tile, int p, Gated& memory) {
  const int gate = tile.word % net::kGates, first = tile.word / net::kGates * 4;
  const int4* const its = words_of(weights) + gate * kQuads;
#pragma unroll
  for (int e = first; e < first + 4; ++e) {
    const int4* const hidden = reinterpret_cast<const int4*>(memory.hidden + tile.group * kHiddenRow + e * kWords);
    int sum = 0;
#pragma unroll
    for (int quad = 0; quad < kQuads; ++quad) {
      const int4 a = hidden[quad], b = its[quad];
      sum = __dp4a(a.w, b.w, __dp4a(a.z, b.z, __dp4a(a.y, b.y, __dp4a(a.x, b.x, sum))));
    }
    memory.gates[(e * net::kGates + gate) * kGateRow + tile.lane_of(p)] = static_cast<float>(sum);
  }
}

// What the gates weigh, added up in the order of the edges: a warp an axis, a lane a point.
__device__ __forceinline__ void add_gated(const NetCloud& cloud, int scale, const Index* list, const net::Place& here,
                                          Index at, Gated& memory) {
  const unsigned lane = lane_number();
  const float per_size = 1.0f / cloud.size[scale][at];
  for_edges([&](int e) {
    const net::Neighbor<float> there = cloud.neighbor(NetCloud::listed(list, at, e), cloud.normal);
    const net::Edge<float> edge = net::edge_to(here, there);
    const net::Pulls<float> pulls = net::pulls_of(here, there, edge);
    const float* const gates = memory.gates + e * net::kGates * kGateRow + lane;
    const float pull = gates[0] * pulls.classical + gates[kGateRow] * pulls.measured;
    const float along = gates[2 * kGateRow] * per_size;
    const Vec term = pull * edge.normal + along * edge.offset;
    memory.terms[0][e][lane] = term.x;
    memory.terms[1][e][lane] = term.y;
    memory.terms[2][e][lane] = term.z;
  });
  __syncthreads();
  const unsigned axis = threadIdx.x / kWarp;
  float sum = 0;
  for (int e = 0; e < net::kNeighbors; ++e) sum = sum + memory.terms[axis][e][lane];
  float& step = (&cloud.step[at].x)[axis];
  step = step + (net::kSumStep / net::kNeighbors) * sum;
}

template <bool kGated>
__global__ void __launch_bounds__(kTile, 6)
    layer_of_leaves(const __grid_constant__ NetCloud cloud, const __grid_constant__ net::Layer layer, int scale,
                    const Index* list) {
  __shared__ LayerMemory<kGated> memory;
  const Tile tile;
  const Index at = tile.first + lane_number();
  const net::Place here = cloud.place(at, cloud.normal);
  find_features(cloud, scale, list, here, at, memory.edges);

  const auto state = [&](int p) { return cloud.state + std::size_t(tile.first + p) * kWords; };
  WarpSums own(layer.own_bias, kRounding);
  own.add_products<kWords>(layer.own, state);
  own.for_pairs([&](int p, int channel, int a, int b) { *reinterpret_cast<int2*>(memory.own[p] + channel) = {a, b}; });
  EdgeWeights weights;
#pragma unroll
  for (int w = 0; w < net::kEdgeWords; ++w) weights.of[w] = words_of(layer.edge)[w * kWords + tile.word];
  __syncthreads();

#pragma unroll
  for (int p = 0; p < kPointsOfThread; ++p) {
    const int4 all = *reinterpret_cast<const int4*>(memory.own[tile.lane_of(p)] + 4 * tile.word);
    const int sums[4] = {all.x, all.y, all.z, all.w};
    int sum[4] = {}, most[4] = {};
#pragma unroll 8
    for (int e = 0; e < net::kNeighbors; ++e) {
      const int4 edge = memory.edges[e][tile.lane_of(p)];
      const uint2 stored = cloud.stored[std::size_t(static_cast<Index>(edge.w)) * kWords + tile.word];
      int hidden[4];
      edge_activations(sums, stored, edge, weights, hidden);
#pragma unroll
      for (int c = 0; c < 4; ++c) {
        sum[c] += hidden[c];
        most[c] = max(most[c], hidden[c]);
      }
      if constexpr (kGated)
        memory.gated.hidden[tile.group * kHiddenRow + e * kWords + tile.word] =
            packed(hidden[0], hidden[1], hidden[2], hidden[3]);
    }
    constexpr int kHalf = net::kNeighbors / 2;
    memory.means[tile.lane_of(p)][tile.word] =
        packed((sum[0] + kHalf) / net::kNeighbors, (sum[1] + kHalf) / net::kNeighbors,
               (sum[2] + kHalf) / net::kNeighbors, (sum[3] + kHalf) / net::kNeighbors);
    memory.largest[tile.lane_of(p)][tile.word] = packed(most[0], most[1], most[2], most[3]);
    if constexpr (kGated) {
      __syncthreads();
      find_gates(layer.gate, tile, p, memory.gated);
      __syncthreads();
    }
  }
  if constexpr (kGated) {
    add_gated(cloud, scale, list, here, at, memory.gated);
  } else {
    __syncthreads();
  }

  WarpSums update(layer.update_bias, kRounding);
  constexpr int kPart = kWords * 4 * net::kChannels;  // bytes of weights
  update.add_products<kWords>(layer.update, state);
  update.add_products<kWords>(layer.update + kPart, [&](int p) { return memory.means[p]; });
  update.add_products<kWords>(layer.update + 2 * kPart, [&](int p) { return memory.largest[p]; });
  __syncthreads();                                                                // all have read the states
  unsigned short* const states = reinterpret_cast<unsigned short*>(cloud.state);  // pairs of channels
  update.for_pairs([&](int p, int channel, int a, int b) {
    states[(std::size_t(tile.first + p) * net::kChannels + channel) / 2] =
        static_cast<unsigned short>(activation_pair(a, b));
  });
}

__device__ __forceinline__ float output_of(const net::Weights& weights, int number, const int4* state) {
  int sum = weights.output_bias[number];
#pragma unroll
  for (int quad = 0; quad < kQuads; ++quad) {
    const int4 a = state[quad], b = words_of(weights.output)[number * kQuads + quad];
    sum = __dp4a(a.w, b.w, __dp4a(a.z, b.z, __dp4a(a.y, b.y, __dp4a(a.x, b.x, sum))));
  }
  return net::kSumStep * static_cast<float>(sum);
}

__global__ void __launch_bounds__(kBlock)
    end_points(const __grid_constant__ NetCloud cloud, const __grid_constant__ net::Weights weights,
               const __grid_constant__ Tree tree, const std::uint8_t* held, Point* out) {
  const Index at = blockIdx.x * kBlock + threadIdx.x;
  if (at >= cloud.places) return;
  const float4 p = tree.points[at];
  if (!is_present(p)) return;
  const net::Place here = cloud.place(at, cloud.normal);
  const Index original = original_of(p);
  if (!net::can_move(here) || held[original] != 0) return;
  const int4* const state = reinterpret_cast<const int4*>(cloud.state + std::size_t(at) * kWords);
  const float along = output_of(weights, 0, state), back = output_of(weights, 1, state) / here.noise;
  const Vec step = (cloud.step[at] + along * here.normal) + back * (here.measured - here.classical);
  const Vec moved = position_of(p) + here.noise * net::trusted(step, weights.squared_trust);
  if (point::is_indexable(moved)) out[original] = {moved.x, moved.y, moved.z};
}

}  // namespace

void measure_scale(Context& context, const NetCloud& cloud, int scale, const Index* list) {
  launch(context, "beginning the net", measure_points, blocks_for(cloud.places, kBlock), kBlock, cloud, scale, list);
}

void begin_net(Context& context, const NetCloud& cloud, const net::Weights& weights) {
  launch(context, "beginning the net", begin_points, blocks_for(cloud.places, kBlock), kBlock, cloud, weights);
}

void store_for_neighbors(Context& context, const NetCloud& cloud, const net::Layer& layer) {
  launch(context, "running the net", store_states, cloud.places / kWarp, kTile, cloud, layer.other);
}

void run_layer(Context& context, const NetCloud& cloud, const net::Layer& layer, int scale, const Index* list) {
  const auto kernel = layer.gate != nullptr ? layer_of_leaves<true> : layer_of_leaves<false>;
  launch(context, "running the net", kernel, cloud.places / kWarp, kTile, cloud, layer, scale, list);
}

void end_net(Context& context, const NetCloud& cloud, const net::Weights& weights, const Tree& tree,
             const std::uint8_t* held, Point* out) {
  launch(context, "ending the net", end_points, blocks_for(cloud.places, kBlock), kBlock, cloud, weights, tree, held,
         out);
}

}  // namespace pointfair::cuda
