// SPDX-License-Identifier: Apache-2.0
// A block of four warps works on a leaf, and tensor cores multiply: of what a point has of its own, a warp has half of
// the channels of half of the points; of the edges, all channels of every fourth point, the 16 edges of one at a time.
#include "cuda/net/layers.cuh"
#include "cuda/net/tensor_cores.cuh"
#include "cuda/runtime/warp.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 128;
constexpr int kWarps = 4, kTile = kWarps * kWarp;  // that have a leaf
constexpr int kWords = net::kChannelWords;
constexpr int kQuads = kWords / 4;  // loads of 16 bytes for a state
// so that banks do not meet
constexpr int kEdgeRow = net::kNeighbors + 1, kGateRow = kWarp + 1, kOwnRow = net::kChannels + 4;
static_assert(net::kChannels == 3 * 16 && net::kNeighbors == 16 && net::kEdgeWords == 3);

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

// A warp's sums: half of the channels of 16 points of a leaf.
class WarpSums {
 public:
  __device__ __forceinline__ explicit WarpSums(const int* bias) {
    for_pairs([&](int, int channel, int& first, int& second) {
      first = bias[channel] + kRounding;
      second = bias[channel + 1] + kRounding;
    });
  }
  // Adds weights x inputs; `row(point)` has the inputs of a point, kLength words.
  template <int kLength, class Row>
  __device__ __forceinline__ void add_products(const signed char* weights, const Row& row) {
    const int* const its = reinterpret_cast<const int*>(weights) + part_ * net::kChannels + channel_ + row_;
    const unsigned *const low = row(point_ + row_) + part_, *const high = row(point_ + row_ + 8) + part_;
#pragma unroll
    for (int word = 0; word < kLength; word += 4)
#pragma unroll
      for (int n = 0; n < kTiles; ++n)
        multiply(sums_[n], low[word], high[word], static_cast<unsigned>(its[word * net::kChannels + 8 * n]));
  }
  // Calls visit(point, channel, its sum, that of the next channel) for all that this lane holds.
  template <class Visit>
  __device__ __forceinline__ void for_pairs(const Visit& visit) {
#pragma unroll
    for (int n = 0; n < kTiles; ++n)
#pragma unroll
      for (int high = 0; high < 2; ++high)
        visit(point_ + row_ + 8 * high, channel_ + 8 * n + 2 * part_, sums_[n][2 * high], sums_[n][2 * high + 1]);
  }

 private:
  static constexpr int kTiles = net::kChannels / 2 / 8;

  int row_ = static_cast<int>(lane_number()) / 4, part_ = static_cast<int>(lane_number()) % 4;
  int point_ = static_cast<int>(threadIdx.x) / kWarp % 2 * 16,
      channel_ = static_cast<int>(threadIdx.x) / kWarp / 2 * (net::kChannels / 2);
  int sums_[kTiles][4];
};

// A point a thread, as the next.
__global__ void __launch_bounds__(kBlock)
    measure_points(const __grid_constant__ NetCloud cloud, LeafRange part, int scale, const Index* list) {
  const Index in_part = blockIdx.x * kBlock + threadIdx.x, at = part.begin * kLeafSize + in_part;
  if (in_part >= part.count() * kLeafSize) return;
  const net::Place here = cloud.place(at);
  net::ScaleSums sums;
#pragma unroll 4
  for (int e = 0; e < net::kNeighbors; ++e) {
    const net::Edge<float> edge = net::edge_to(here, cloud.neighbor(NetCloud::listed(list, at, e)));
    sums.offset = sums.offset + edge.offset;
    sums.square = sums.square + edge.square;
    sums.height = sums.height + edge.height;
    sums.squared_height = sums.squared_height + edge.height * edge.height;
    sums.sine = sums.sine + edge.sine;
  }
  const net::Scale measured = net::scale_of(sums);
  cloud.scale[scale][scale == 0 ? at : in_part] = measured;
  cloud.size[scale][at] = measured.size;
}

__global__ void __launch_bounds__(kBlock)
    begin_points(const __grid_constant__ NetCloud cloud, LeafRange part, const __grid_constant__ net::Weights weights) {
  const Index in_part = blockIdx.x * kBlock + threadIdx.x, at = part.begin * kLeafSize + in_part;
  if (in_part >= part.count() * kLeafSize) return;
  net::Place here = cloud.place(at);
  net::Scale scales[net::kScales];
#pragma unroll
  for (int s = 0; s < net::kScales; ++s) scales[s] = cloud.scale[s][s == 0 ? at : in_part];
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
    cloud.next[std::size_t(at) * kWords + word] =
        packed(activation(sums[0]), activation(sums[1]), activation(sums[2]), activation(sums[3]));
  }
}

__device__ __forceinline__ unsigned activation_pair(int a, int b) {
  return static_cast<unsigned>(activation(a)) | static_cast<unsigned>(activation(b)) << 8;
}
// Of two sums, each held between 0 and what gives the largest activation, as halves of a word.
__device__ __forceinline__ unsigned held_halves(int low, int high) {
  unsigned halves;
  asm("cvt.pack.sat.s16.s32 %0, %1, %2;" : "=r"(halves) : "r"(high), "r"(low));
  return __vimin_s16x2_relu(halves, ((128u << net::kSumShift) - 1) * 0x00010001u);
}
// Of four such halves the activations, as bytes.
__device__ __forceinline__ unsigned activation_bytes(unsigned low, unsigned high) {
  constexpr unsigned kToUpperByte = 1u << (8 - net::kSumShift);
  return __byte_perm(low * kToUpperByte, high * kToUpperByte, 0x7531);
}

struct None {};
struct Gates {
  float of[net::kNeighbors * net::kGates * kGateRow];
};
template <bool kGated>
struct LayerMemory {
  int4 edges[kWarp][kEdgeRow];  // of each point, words of features, and the neighbour
  unsigned means[kWarp][kWords], largest[kWarp][kWords];
  union {
    alignas(16) int own[kWarp][kOwnRow];
    float terms[3][net::kNeighbors][kWarp];
  };
  std::conditional_t<kGated, Gates, None> gates;
};

// A thread's edges are those of one lane's point: every fourth of them, by its warp.
template <class Visit>
__device__ __forceinline__ void for_edges(const Visit& visit) {
#pragma unroll 1
  for (int e = static_cast<int>(threadIdx.x) / kWarp; e < net::kNeighbors; e += kWarps) visit(e);
}

__device__ __forceinline__ void find_features(const NetCloud& cloud, int scale, const Index* list,
                                              const net::Place& here, Index at, int4 (&edges)[kWarp][kEdgeRow]) {
  const Vec side = cloud.side[at];
  const float size = cloud.size[scale][at];
  const auto listed = [&](int e) { return NetCloud::listed(list, at, e & (net::kNeighbors - 1)); };
  Index ahead = listed(static_cast<int>(threadIdx.x) / kWarp);
  for_edges([&](int e) {
    const Index its = ahead;
    ahead = listed(e + kWarps);
    const net::Neighbor<float> there = cloud.neighbor(its);
    int words[net::kEdgeWords];
    net::edge_words(here, side, size, there, net::edge_to(here, there), words);
    edges[lane_number()][e] = {words[0], words[1], words[2], static_cast<int>(its)};
  });
}

// The edges of one point as a matrix: its rows are channels, its columns the 16 edges, two matrices of 16 x 8 for each
// 16 channels. A lane has the channels 16 m + 2 (lane / 4) and the next of the edges 2 (lane % 4) and the next, and of
// those 8 on.
template <bool kGated, bool kClamps>
class Edges {
 public:
  __device__ __forceinline__ explicit Edges(const net::Layer& layer) {
    const int* const other = reinterpret_cast<const int*>(layer.other);
    const int* const edge = reinterpret_cast<const int*>(layer.edge);
#pragma unroll
    for (int m = 0; m < kTiles; ++m)
#pragma unroll
      for (int high = 0; high < 2; ++high) {
        const int channel = 16 * m + 2 * row_ + high;
#pragma unroll
        for (int k = 0; k < kTiles; ++k) other_[m][k][high] = other[(4 * k + part_) * net::kChannels + channel];
        edge_[m][high] = part_ < net::kEdgeWords ? edge[part_ * net::kChannels + channel] : 0;
      }
    if constexpr (kGated)
#pragma unroll
      for (int m = 0; m < kTiles; ++m)
        gate_[m] = row_ < net::kGates ? reinterpret_cast<const int*>(layer.gate)[row_ * kWords + 4 * m + part_] : 0;
  }

  __device__ __forceinline__ void visit(const unsigned* states, int p, LayerMemory<kGated>& memory) const {
    unsigned features[2], inputs[2][kTiles];
#pragma unroll
    for (int n = 0; n < 2; ++n) {
      const unsigned* const edge = reinterpret_cast<const unsigned*>(&memory.edges[p][8 * n + row_]);
      const unsigned* const its = states + std::size_t(edge[net::kEdgeWords]) * kWords + part_;
#pragma unroll
      for (int k = 0; k < kTiles; ++k) inputs[n][k] = its[4 * k];
      features[n] = edge[part_];  // beside the last are weights of 0
    }
    int gates[2][4] = {}, sums[kTiles][4];
    unsigned most[kTiles];
#pragma unroll
    for (int m = 0; m < kTiles; ++m) {
      const int2 own = *reinterpret_cast<const int2*>(memory.own[p] + 16 * m + 2 * row_);
      const int from_low = before(own.x), from_high = before(own.y);
      const int from[4] = {from_low, from_low, from_high, from_high};
      unsigned held[2][2];
#pragma unroll
      for (int n = 0; n < 2; ++n) {
        int values[4];
        multiply_two(values, other_[m][0], other_[m][1], inputs[n][0], inputs[n][1], from);
        multiply(values, other_[m][2][0], other_[m][2][1], inputs[n][2]);
#pragma unroll
        for (int i = 0; i < 4; ++i) values[i] = after(values[i], i < 2 ? own.x : own.y);
        multiply(values, edge_[m][0], edge_[m][1], features[n]);
        held[n][0] = held_halves(values[0], values[1]);
        held[n][1] = held_halves(values[2], values[3]);
      }
      // of each of the two channels, over the four edges
      const unsigned most_low = __vmaxu2(held[0][0], held[1][0]), most_high = __vmaxu2(held[0][1], held[1][1]);
      most[m] = __vmaxu2(__byte_perm(most_low, most_high, 0x5410), __byte_perm(most_low, most_high, 0x7632));
      const unsigned low = activation_bytes(held[0][0], held[1][0]), high = activation_bytes(held[0][1], held[1][1]);
      multiply(sums[m], low, high, 0x01010101u, {0, 0, 0, 0});
      if constexpr (kGated) {
        multiply(gates[0], gate_[m], 0, transposed(__byte_perm(low, high, 0x5140)));
        multiply(gates[1], gate_[m], 0, transposed(__byte_perm(low, high, 0x7362)));
      }
    }
    keep(sums, most, memory.means[p], memory.largest[p]);
    if constexpr (kGated) {
      if (row_ < net::kGates) {
#pragma unroll
        for (int n = 0; n < 2; ++n)
#pragma unroll
          for (int i = 0; i < 2; ++i)
            memory.gates.of[((8 * n + 2 * part_ + i) * net::kGates + row_) * kGateRow + p] =
                static_cast<float>(gates[n][i]);
      }
    }
  }

 private:
  static constexpr int kTiles = net::kChannels / 16;

  // What of a neighbour's sum counts: 16 bits, in steps of 2^kStoredShift, rounded. The whole steps of the point's own
  // sum are there before it where nothing needs to be clamped, so that one instruction rounds and adds.
  static constexpr int kStep = 1 << net::kStoredShift;
  __device__ __forceinline__ static int before(int own) { return kClamps ? kStep / 2 : (own & -kStep) | kStep / 2; }
  __device__ __forceinline__ static int after(int sum, int own) {
    if constexpr (kClamps) return clamped(sum & -kStep, -32768 * kStep, 32767 * kStep) + own;
    int chosen;  // sum but for the bits of kStep - 1, which are those of own
    asm("lop3.b32 %0, %1, %2, %3, 0xb8;" : "=r"(chosen) : "r"(sum), "r"(kStep - 1), "r"(own));
    return chosen;
  }
  // Of the four lanes that have the same channels three keep two each.
  __device__ __forceinline__ void keep(const int (&sums)[kTiles][4], unsigned (&most)[kTiles], unsigned* means,
                                       unsigned* largest) const {
#pragma unroll
    for (int m = 0; m < kTiles; ++m)
#pragma unroll
      for (int step = 1; step < 4; step *= 2) most[m] = __vmaxu2(most[m], __shfl_xor_sync(kAllLanes, most[m], step));
    if (part_ == kTiles) return;
    const auto mine = [&](auto first, auto second, auto third) {
      return part_ == 0 ? first : part_ == 1 ? second : third;
    };
    const auto mean = [&](int which) {
      const int sum = mine(sums[0][which], sums[1][which], sums[2][which]);
      return static_cast<unsigned>(sum + net::kNeighbors / 2) / net::kNeighbors;
    };
    reinterpret_cast<unsigned short*>(means)[8 * part_ + row_] = static_cast<unsigned short>(mean(0) | mean(2) << 8);
    reinterpret_cast<unsigned short*>(largest)[8 * part_ + row_] =
        static_cast<unsigned short>(activation_bytes(mine(most[0], most[1], most[2]), 0));
  }

  int row_ = static_cast<int>(lane_number()) / 4, part_ = static_cast<int>(lane_number()) % 4;
  unsigned other_[kTiles][kTiles][2], edge_[kTiles][2];
  unsigned gate_[kTiles];
};

// What the gates weigh, added up in the order of the edges: a warp an axis, a lane a point.
__device__ __forceinline__ void add_gated(const NetCloud& cloud, int scale, const net::Place& here, Index at,
                                          LayerMemory<true>& memory) {
  const unsigned lane = lane_number();
  const float per_size = 1.0f / cloud.size[scale][at];
  for_edges([&](int e) {
    const Index its = static_cast<Index>(memory.edges[lane][e].w);
    const net::Neighbor<float> there = cloud.neighbor(its);
    const net::Edge<float> edge = net::edge_to(here, there);
    const net::Pulls<float> pulls = net::pulls_of(here, there, edge);
    const float* const gates = memory.gates.of + e * net::kGates * kGateRow + lane;
    const float pull = gates[0] * pulls.classical + gates[kGateRow] * pulls.measured;
    const float along = gates[2 * kGateRow] * per_size;
    const Vec term = pull * edge.normal + along * edge.offset;
    memory.terms[0][e][lane] = term.x;
    memory.terms[1][e][lane] = term.y;
    memory.terms[2][e][lane] = term.z;
  });
  __syncthreads();
  const unsigned axis = threadIdx.x / kWarp;
  if (axis == 3) return;
  float sum = 0;
  for (int e = 0; e < net::kNeighbors; ++e) sum = sum + memory.terms[axis][e][lane];
  float& step = (&cloud.step[at].x)[axis];
  step = step + (net::kSumStep / net::kNeighbors) * sum;
}

template <bool kGated, bool kClamps>
__global__ void __launch_bounds__(kTile, 6)
    layer_of_leaves(const __grid_constant__ NetCloud cloud, LeafRange part, const __grid_constant__ net::Layer layer,
                    int scale, const Index* list) {
  __shared__ LayerMemory<kGated> memory;
  const Index first = (part.begin + blockIdx.x) * kLeafSize, at = first + lane_number();
  const net::Place here = cloud.place(at);
  find_features(cloud, scale, list, here, at, memory.edges);

  const auto state = [&](int p) { return cloud.state + std::size_t(first + p) * kWords; };
  {
    WarpSums own(layer.own_bias);
    own.add_products<kWords>(layer.own, state);
    own.for_pairs([&](int p, int channel, int a, int b) {
      *reinterpret_cast<int2*>(memory.own[p] + channel) = {a, b};
    });
  }
  __syncthreads();

  {
    const Edges<kGated, kClamps> edges(layer);
#pragma unroll 1
    for (int p = static_cast<int>(threadIdx.x) / kWarp; p < kWarp; p += kWarps) edges.visit(cloud.state, p, memory);
  }
  __syncthreads();
  if constexpr (kGated) add_gated(cloud, scale, here, at, memory);

  WarpSums update(layer.update_bias);
  constexpr int kPart = kWords * 4 * net::kChannels;  // bytes of weights
  update.add_products<kWords>(layer.update, state);
  update.add_products<kWords>(layer.update + kPart, [&](int p) { return memory.means[p]; });
  update.add_products<kWords>(layer.update + 2 * kPart, [&](int p) { return memory.largest[p]; });
  unsigned short* const next = reinterpret_cast<unsigned short*>(cloud.next);  // pairs of channels
  update.for_pairs([&](int p, int channel, int a, int b) {
    next[(std::size_t(first + p) * net::kChannels + channel) / 2] = static_cast<unsigned short>(activation_pair(a, b));
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
  const net::Place here = cloud.place(at);
  const Index original = original_of(p);
  if (!net::can_move(here) || held[original] != 0) return;
  const int4* const state = reinterpret_cast<const int4*>(cloud.state + std::size_t(at) * kWords);
  const float along = output_of(weights, 0, state), back = output_of(weights, 1, state) / here.noise;
  const Vec step = (cloud.step[at] + along * here.normal) + back * (here.measured - here.classical);
  const Vec moved = position_of(p) + here.noise * net::trusted(step, weights.squared_trust);
  if (point::is_indexable(moved)) out[original] = {moved.x, moved.y, moved.z};
}

}  // namespace

void measure_scale(Context& context, const NetCloud& cloud, LeafRange part, int scale, const Index* list) {
  launch(context, "beginning the net", measure_points, blocks_for(part.count() * kLeafSize, kBlock), kBlock, cloud,
         part, scale, list);
}

void begin_net(Context& context, const NetCloud& cloud, LeafRange part, const net::Weights& weights) {
  launch(context, "beginning the net", begin_points, blocks_for(part.count() * kLeafSize, kBlock), kBlock, cloud, part,
         weights);
}

void run_layer(Context& context, const NetCloud& cloud, LeafRange part, const net::Layer& layer, int scale,
               const Index* list, bool clamps) {
  const bool gated = layer.gate != nullptr;
  const auto kernel = clamps ? (gated ? layer_of_leaves<true, true> : layer_of_leaves<false, true>)
                             : (gated ? layer_of_leaves<true, false> : layer_of_leaves<false, false>);
  launch(context, "running the net", kernel, part.count(), kTile, cloud, part, layer, scale, list);
}

void end_net(Context& context, const NetCloud& cloud, const net::Weights& weights, const Tree& tree,
             const std::uint8_t* held, Point* out) {
  launch(context, "ending the net", end_points, blocks_for(cloud.places, kBlock), kBlock, cloud, weights, tree, held,
         out);
}

}  // namespace pointfair::cuda
