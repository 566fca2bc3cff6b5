// SPDX-License-Identifier: Apache-2.0
// The net of src/point/net.h over the points of a cloud: the neighbours of a point lie in the lanes of packs. Part of
// src/cpu/net_kernels.cpp.
#pragma once

#include "cpu/kernels.h"
#include "cpu/net_arithmetic.h"

namespace pointfair::cpu::POINTFAIR_ISA {

inline constexpr int kPlaceFloats = sizeof(net::Place) / sizeof(float);

// The neighbours of one scale, number by number.
struct alignas(64) NeighborRows {
  float of[kPlaceFloats][net::kNeighbors];

  void gather(const net::Place* places, const Index* list) {
    for (int e = 0; e < net::kNeighbors; ++e) {
      const float* from = &places[list[e]].classical.x;
      for (int i = 0; i < kPlaceFloats; ++i) of[i][e] = from[i];
    }
  }
  POINTFAIR_INLINE net::Neighbor<Floats> pack(int first) const {
    const auto at = [&](int i) { return load(of[i] + first); };
    return {{at(0), at(1), at(2)}, {at(3), at(4), at(5)}, {at(6), at(7), at(8)}, at(9)};
  }
};

inline const Index* list_of(const NetCloud& cloud, int scale, Index i) {
  return cloud.lists[scale] + std::size_t(i) * net::kNeighbors;
}

inline void net_slide(const NetSlide& cloud, Index first, Index last) {
  struct alignas(64) {
    float x[net::kNeighbors], y[net::kNeighbors], z[net::kNeighbors], square[net::kNeighbors];
  } of;
  for (Index i = first; i < last; ++i) {
    const net::Place& start = cloud.starts[i];
    const point::Vec3<float> here = cloud.from[i];
    cloud.to[i] = here;
    if (!net::can_move(start)) continue;
    const Index* const list = cloud.list + std::size_t(i) * net::kNeighbors;
    for (int e = 0; e < net::kNeighbors; ++e) {
      const point::Vec3<float>& there = cloud.from[list[e]];
      of.x[e] = there.x;
      of.y[e] = there.y;
      of.z[e] = there.z;
    }
    const auto store_offset = [&](int at, point::Vec3<Floats> offset) {
      store(of.x + at, offset.x);
      store(of.y + at, offset.y);
      store(of.z + at, offset.z);
    };
    for (int at = 0; at < net::kNeighbors; at += kLanes) {
      const point::Vec3<Floats> there = {load(of.x + at), load(of.y + at), load(of.z + at)};
      const auto offset = net::along_plane(there - net::spread_of<Floats>(here), net::spread_of<Floats>(start.normal));
      store_offset(at, offset);
      store(of.square + at, point::squared_length(offset));
    }
    float squares = 0;
    for (const float square : of.square) squares = squares + square;
    const Floats per_mean_square = broadcast(net::per_mean_square(squares));
    for (int at = 0; at < net::kNeighbors; at += kLanes)
      store_offset(
          at, net::push_of(point::Vec3<Floats>{load(of.x + at), load(of.y + at), load(of.z + at)}, per_mean_square));
    point::Vec3<float> pushes{};
    for (int e = 0; e < net::kNeighbors; ++e) pushes = pushes + point::Vec3<float>{of.x[e], of.y[e], of.z[e]};
    cloud.to[i] = net::slid(start, here, pushes);
  }
}

// Means over a scale; with the normal as it is, so its heights may have the other sign.
inline net::Scale measure_scale(const net::Place& here, const NeighborRows& rows) {
  struct alignas(64) {
    float x[net::kNeighbors], y[net::kNeighbors], z[net::kNeighbors], square[net::kNeighbors], height[net::kNeighbors],
        sine[net::kNeighbors];
  } of;
  for (int first = 0; first < net::kNeighbors; first += kLanes) {
    const net::Edge<Floats> e = net::edge_to(here, rows.pack(first));
    store(of.x + first, e.offset.x);
    store(of.y + first, e.offset.y);
    store(of.z + first, e.offset.z);
    store(of.square + first, e.square);
    store(of.height + first, e.height);
    store(of.sine + first, e.sine);
  }
  net::ScaleSums sums;
  for (int e = 0; e < net::kNeighbors; ++e) {
    sums.offset = sums.offset + point::Vec3<float>{of.x[e], of.y[e], of.z[e]};
    sums.square = sums.square + of.square[e];
    sums.height = sums.height + of.height[e];
    sums.squared_height = sums.squared_height + of.height[e] * of.height[e];
    sums.sine = sums.sine + of.sine[e];
  }
  return net::scale_of(sums);
}

inline void store_state(const net::Weights& weights, int layer, const std::uint8_t* state, std::int16_t* out) {
  SumRow sums(nullptr, kStoredRounding);
  sums.add_products(state, net::kChannels, weights.layers[layer].other);
  store_for_neighbors(sums.of, out);
}

// Turns normals, and makes the first state of points [first, last).
inline void net_begin(const NetCloud& cloud, const net::Weights& weights, Index first, Index last) {
  NeighborRows rows;
  for (Index i = first; i < last; ++i) {
    net::Place here = cloud.measured_places[i];
    net::Scale scales[net::kScales];
    for (int s = 0; s < net::kScales; ++s) {
      rows.gather(cloud.measured_places, list_of(cloud, s, i));
      scales[s] = measure_scale(here, rows);
      cloud.sizes[s][i] = scales[s].size;
    }
    const net::Sides sides = net::sides_of(here.normal, scales[1].offset);
    const bool is_turned = point::dot(scales[1].offset, here.normal) < 0;
    for (net::Scale& scale : scales) scale.height = is_turned ? -scale.height : scale.height;
    here.normal = sides.up;
    cloud.places[i] = here;
    cloud.sides[i] = sides.side;
    int words[net::kPointWords];
    net::point_words(here, scales, words);
    SumRow sums(weights.input_bias, kRounding);
    sums.add_products(reinterpret_cast<const std::uint8_t*>(words), net::kPointFeatures, weights.input);
    std::uint8_t* state = cloud.states + std::size_t(i) * net::kChannels;
    store_activations(sums.of, state);
    store_state(weights, 0, state, cloud.stored[0] + std::size_t(i) * net::kChannels);
  }
}

// The part of the step that gates weigh, added up neighbour by neighbour.
class GatedSum {
 public:
  void add(const net::Place& here, const net::Neighbor<Floats>& there, const net::Edge<Floats>& e, int first) {
    const net::Pulls<Floats> pulls = net::pulls_of(here, there, e);
    const Floats* const columns[] = {&pulls.classical, &pulls.measured, &e.normal.x, &e.normal.y,
                                     &e.normal.z,      &e.offset.x,     &e.offset.y, &e.offset.z};
    for (int i = 0; i < 8; ++i) store(of_[i] + first, *columns[i]);
  }
  point::Vec3<float> sum(const std::uint8_t (*hidden)[net::kChannels], const std::int8_t* gate, float size) const {
    const float per_size = 1.0f / size;
    point::Vec3<float> sum{};
    for (int e = 0; e < net::kNeighbors; ++e) {
      float gates[net::kGates + 1];
      find_gates(hidden[e], gate, gates);
      const float pull = gates[0] * of_[0][e] + gates[1] * of_[1][e], along = gates[2] * per_size;
      sum = sum + (pull * point::Vec3<float>{of_[2][e], of_[3][e], of_[4][e]} +
                   along * point::Vec3<float>{of_[5][e], of_[6][e], of_[7][e]});
    }
    return (net::kSumStep / net::kNeighbors) * sum;
  }

 private:
  alignas(64) float of_[8][net::kNeighbors];
};

// Mean, rounded, and largest of each channel over the edges.
POINTFAIR_INLINE void summarise(const std::uint8_t (*hidden)[net::kChannels], std::uint8_t* mean,
                                std::uint8_t* largest) {
  alignas(64) std::uint16_t sum[net::kChannels];
  alignas(64) std::uint8_t most[net::kChannels] = {};
  for (std::uint16_t& s : sum) s = net::kNeighbors / 2;
  for (int e = 0; e < net::kNeighbors; ++e)
    for (int c = 0; c < net::kChannels; ++c) {
      sum[c] = static_cast<std::uint16_t>(sum[c] + hidden[e][c]);
      most[c] = hidden[e][c] > most[c] ? hidden[e][c] : most[c];
    }
  for (int c = 0; c < net::kChannels; ++c) mean[c] = static_cast<std::uint8_t>(sum[c] / net::kNeighbors);
  __builtin_memcpy(largest, most, sizeof most);
}

// One layer of points [first, last), and after the last one their whole steps, within the trust.
inline void net_layer(const NetCloud& cloud, const net::Weights& weights, int layer, Index first, Index last) {
  const net::Layer& its = weights.layers[layer];
  const int scale = net::kPlan[layer];
  const std::int16_t* const stored = cloud.stored[layer % 2];
  NeighborRows rows;
  GatedSum gated;
  alignas(64) std::uint8_t hidden[net::kNeighbors][net::kChannels], joined[3 * net::kChannels];
  alignas(64) int edge_words[net::kEdgeWords][net::kNeighbors];
  for (Index i = first; i < last; ++i) {
    const Index* const list = list_of(cloud, scale, i);
    const net::Place& here = cloud.places[i];
    const float size = cloud.sizes[scale][i];
    rows.gather(cloud.places, list);
    for (int at = 0; at < net::kNeighbors; at += kLanes) {
      const net::Neighbor<Floats> there = rows.pack(at);
      const net::Edge<Floats> e = net::edge_to(here, there);
      Ints words[net::kEdgeWords];
      net::edge_words(here, cloud.sides[i], size, there, e, words);
      for (int w = 0; w < net::kEdgeWords; ++w) store(reinterpret_cast<unsigned*>(edge_words[w] + at), words[w]);
      if (its.gate != nullptr) gated.add(here, there, e, at);
    }
    std::uint8_t* const state = cloud.states + std::size_t(i) * net::kChannels;
    SumRow own(its.own_bias, kRounding);
    own.add_products(state, net::kChannels, its.own);
    for (int e = 0; e < net::kNeighbors; ++e) {
      const int its_words[net::kEdgeWords] = {edge_words[0][e], edge_words[1][e], edge_words[2][e]};
      edge_activations(own, stored + std::size_t(list[e]) * net::kChannels, its_words, its.edge, hidden[e]);
    }
    __builtin_memcpy(joined, state, net::kChannels);
    summarise(hidden, joined + net::kChannels, joined + 2 * net::kChannels);
    if (its.gate != nullptr) cloud.steps[i] = cloud.steps[i] + gated.sum(hidden, its.gate, size);
    SumRow update(its.update_bias, kRounding);
    update.add_products(joined, 3 * net::kChannels, its.update);
    store_activations(update.of, state);
    if (layer + 1 < net::kLayers) {
      store_state(weights, layer + 1, state, cloud.stored[1 - layer % 2] + std::size_t(i) * net::kChannels);
      continue;
    }
    float out[net::kOutputs];
    for (int o = 0; o < net::kOutputs; ++o)
      out[o] = net::kSumStep *
               static_cast<float>(weights.output_bias[o] + product(state, weights.output + o * net::kChannels));
    const float back = out[1] / here.noise;
    const point::Vec3<float> step = (cloud.steps[i] + out[0] * here.normal) + back * (here.measured - here.classical);
    cloud.steps[i] = net::trusted(step, weights.squared_trust);
  }
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
