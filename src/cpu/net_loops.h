// SPDX-License-Identifier: Apache-2.0
// The net of src/point/net.h over the points of a cloud: the neighbours of a point lie in the lanes of packs. Part of
// src/cpu/net_kernels.cpp.
#pragma once

#include "cpu/kernels.h"
#include "cpu/net_arithmetic.h"

namespace pointfair::cpu::POINTFAIR_ISA {

static_assert(sizeof(net::Place) == 10 * sizeof(float));
inline constexpr int kPacks = net::kNeighbors / kLanes;

// The next kLanes neighbours of a list.
POINTFAIR_INLINE net::Neighbor<Floats> neighbors_at(const net::Place* places, const Index* list) {
  const auto columns = [&](int first) {
    return four_columns([&](int lane) { return &places[list[lane]].classical.x + first; });
  };
  const std::array<Floats, 4> a = columns(0), b = columns(3), c = columns(6);
  return {{a[0], a[1], a[2]}, {a[3], b[1], b[2]}, {c[0], c[1], c[2]}, c[3]};
}

// Vectors of the neighbours, and their sum in the order of the list.
POINTFAIR_INLINE void store_terms(float (*terms)[net::kNeighbors], int pack, const point::Vec3<Floats>& of) {
  store(terms[0] + pack * kLanes, of.x);
  store(terms[1] + pack * kLanes, of.y);
  store(terms[2] + pack * kLanes, of.z);
}
POINTFAIR_INLINE point::Vec3<float> sum_of_terms(const float (*terms)[net::kNeighbors]) {
  point::Vec3<float> sum{};
  for (int e = 0; e < net::kNeighbors; ++e) sum = sum + point::Vec3<float>{terms[0][e], terms[1][e], terms[2][e]};
  return sum;
}

inline const Index* list_of(const NetCloud& cloud, int scale, Index i) {
  return cloud.lists[scale] + std::size_t(i) * net::kNeighbors;
}

inline void net_slide(const NetSlide& cloud, Index first, Index last) {
  alignas(64) float squares[net::kNeighbors], terms[3][net::kNeighbors];
  for (Index i = first; i < last; ++i) {
    const net::Place& start = cloud.starts[i];
    const point::Vec3<float> here = cloud.from[i];
    cloud.to[i] = here;
    if (!net::can_move(start)) continue;
    const Index* const list = cloud.list + std::size_t(i) * net::kNeighbors;
    point::Vec3<Floats> offsets[kPacks];
    for (int pack = 0; pack < kPacks; ++pack) {
      // reads one float behind the last point, for which there is room
      const std::array<Floats, 4> there =
          four_columns([&](int lane) { return &cloud.from[list[pack * kLanes + lane]].x; });
      offsets[pack] = net::along_plane(point::Vec3<Floats>{there[0], there[1], there[2]} - net::spread_of<Floats>(here),
                                       net::spread_of<Floats>(start.normal));
      store(squares + pack * kLanes, point::squared_length(offsets[pack]));
    }
    float sum = 0;
    for (const float square : squares) sum = sum + square;
    const Floats per_mean_square = broadcast(net::per_mean_square(sum));
    for (int pack = 0; pack < kPacks; ++pack) store_terms(terms, pack, net::push_of(offsets[pack], per_mean_square));
    cloud.to[i] = net::slid(start, here, sum_of_terms(terms));
  }
}

// Means over a scale; with the normal as it is, so its heights may have the other sign.
inline net::Scale measure_scale(const net::Place& here, const net::Place* places, const Index* list) {
  struct alignas(64) {
    float x[net::kNeighbors], y[net::kNeighbors], z[net::kNeighbors], square[net::kNeighbors], height[net::kNeighbors],
        sine[net::kNeighbors];
  } of;
  for (int first = 0; first < net::kNeighbors; first += kLanes) {
    const net::Edge<Floats> e = net::edge_to(here, neighbors_at(places, list + first));
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

// What a layer keeps of the states of points [first, last) for their neighbours.
inline void net_store(const NetCloud& cloud, const net::Weights& weights, int layer, Index first, Index last) {
  for (std::size_t i = first; i < last; ++i) {
    SumRow sums(nullptr, kStoredRounding);
    sums.add_products(cloud.states + i * net::kChannels, net::kChannels, weights.layers[layer].other);
    store_for_neighbors(sums.of, cloud.stored + i * net::kChannels);
  }
}

// Notes which normals are to be turned, and makes the first state of points [first, last).
inline void net_begin(const NetCloud& cloud, const net::Weights& weights, Index first, Index last) {
  for (Index i = first; i < last; ++i) {
    net::Place here = cloud.places[i];
    net::Scale scales[net::kScales];
    for (int s = 0; s < net::kScales; ++s) {
      scales[s] = measure_scale(here, cloud.places, list_of(cloud, s, i));
      cloud.sizes[s][i] = scales[s].size;
    }
    const net::Sides sides = net::sides_of(here.normal, scales[1].offset);
    const bool is_turned = point::dot(scales[1].offset, here.normal) < 0;
    for (net::Scale& scale : scales) scale.height = is_turned ? -scale.height : scale.height;
    here.normal = sides.up;
    cloud.turned[i] = is_turned;
    cloud.sides[i] = sides.side;
    int words[net::kPointWords];
    net::point_words(here, scales, words);
    SumRow sums(weights.input_bias, kRounding);
    sums.add_products(reinterpret_cast<const std::uint8_t*>(words), net::kPointFeatures, weights.input);
    store_row(activations_of(sums.of), cloud.states + std::size_t(i) * net::kChannels);
  }
}

// The part of the step that gates weigh, added up neighbour by neighbour.
class GatedSum {
 public:
  POINTFAIR_INLINE void take(const net::Place& here, const net::Neighbor<Floats>& there, const net::Edge<Floats>& e,
                             int pack) {
    pulls_[pack] = net::pulls_of(here, there, e);
    normals_[pack] = e.normal;
    offsets_[pack] = e.offset;
  }
  POINTFAIR_INLINE point::Vec3<float> sum(const ActivationRow* rows, const GateWeights& weights, float size) const {
    alignas(64) float gates[net::kGates][net::kNeighbors], terms[3][net::kNeighbors];
    for (int g = 0; g < net::kGates; ++g) find_gate(rows, weights.of[g], gates[g]);
    const Floats per_size = broadcast(1.0f / size);
    for (int pack = 0; pack < kPacks; ++pack) {
      const auto gate = [&](int g) { return load(gates[g] + pack * kLanes); };
      const Floats pull = gate(0) * pulls_[pack].classical + gate(1) * pulls_[pack].measured;
      const Floats along = gate(2) * per_size;
      store_terms(terms, pack, pull * normals_[pack] + along * offsets_[pack]);
    }
    return (net::kSumStep / net::kNeighbors) * sum_of_terms(terms);
  }

 private:
  net::Pulls<Floats> pulls_[kPacks];
  point::Vec3<Floats> normals_[kPacks], offsets_[kPacks];
};

// One layer of points [first, last), and after the last one their whole steps, within the trust.
template <bool kGated>
inline void net_layer_of(const NetCloud& cloud, const net::Weights& weights, int layer, Index first, Index last) {
  const net::Layer& its = weights.layers[layer];
  const int scale = net::kPlan[layer];
  const EdgeWeights edge_weights(its.edge);
  const std::int8_t none[net::kGates * net::kChannels] = {};
  const GateWeights gates(kGated ? its.gate : none);
  GatedSum gated;
  ActivationRow rows[net::kNeighbors];
  alignas(64) int edge_words[net::kEdgeWords][net::kNeighbors];
  alignas(64) std::uint8_t mean[net::kChannels], largest[net::kChannels];
  for (Index i = first; i < last; ++i) {
    const Index* const list = list_of(cloud, scale, i);
    const net::Place& here = cloud.places[i];
    const float size = cloud.sizes[scale][i];
    for (int pack = 0; pack < kPacks; ++pack) {
      const net::Neighbor<Floats> there = neighbors_at(cloud.places, list + pack * kLanes);
      const net::Edge<Floats> e = net::edge_to(here, there);
      Ints words[net::kEdgeWords];
      net::edge_words(here, cloud.sides[i], size, there, e, words);
      for (int w = 0; w < net::kEdgeWords; ++w)
        store(reinterpret_cast<unsigned*>(edge_words[w] + pack * kLanes), words[w]);
      if constexpr (kGated) gated.take(here, there, e, pack);
    }
    std::uint8_t* const state = cloud.states + std::size_t(i) * net::kChannels;
    SumRow own(its.own_bias, kRounding);
    own.add_products(state, net::kChannels, its.own);
    RowSummary summary;
    const auto row_of = [&](int e) {
      const int its_words[net::kEdgeWords] = {edge_words[0][e], edge_words[1][e], edge_words[2][e]};
      return edge_weights.activations(own, cloud.stored + std::size_t(list[e]) * net::kChannels, its_words);
    };
    for (int e = 0; e < net::kNeighbors; e += 2) {
      const ActivationRow a = row_of(e), b = row_of(e + 1);
      summary.add(a, b);
      if constexpr (kGated) rows[e] = a, rows[e + 1] = b;
    }
    store_row(summary.mean(), mean);
    store_row(summary.largest(), largest);
    if constexpr (kGated) cloud.steps[i] = cloud.steps[i] + gated.sum(rows, gates, size);
    // in three rows, so that few products wait for the one before
    SumRow update(its.update_bias, kRounding), of_mean(nullptr, 0), of_largest(nullptr, 0);
    constexpr int kInputs = net::kChannels * net::kChannels;
    update.add_products(state, net::kChannels, its.update);
    of_mean.add_products(mean, net::kChannels, its.update + kInputs);
    of_largest.add_products(largest, net::kChannels, its.update + 2 * kInputs);
    update.add(of_mean);
    update.add(of_largest);
    store_row(activations_of(update.of), state);
    if (layer + 1 < net::kLayers) continue;
    float out[net::kOutputs];
    for (int o = 0; o < net::kOutputs; ++o)
      out[o] = net::kSumStep *
               static_cast<float>(weights.output_bias[o] + product(state, weights.output + o * net::kChannels));
    const float back = out[1] / here.noise;
    const point::Vec3<float> step = (cloud.steps[i] + out[0] * here.normal) + back * (here.measured - here.classical);
    cloud.steps[i] = net::trusted(step, weights.squared_trust);
  }
}
inline void net_layer(const NetCloud& cloud, const net::Weights& weights, int layer, Index first, Index last) {
  if (weights.layers[layer].gate != nullptr) {
    net_layer_of<true>(cloud, weights, layer, first, last);
  } else {
    net_layer_of<false>(cloud, weights, layer, first, last);
  }
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
