// SPDX-License-Identifier: Apache-2.0
// The net of method learned, at one point (docs/learned.md): what it reads of the point and its neighbours, in units of
// the noise, and its layers in whole numbers. Activations go from 0 to 127 in steps of 2^-5, weights from -127 to 127
// in steps of 2^-6; sums are 32-bit, in steps of 2^-11, so that no order of theirs and no instruction set matters. What
// is float has operations that round alike everywhere. training/net/reference.py says the same in Python.
#pragma once

#include "point/vec.h"

namespace pointfair::point::net {

inline constexpr int kNeighbors = 16, kScales = 4, kChannels = 48, kLayers = 7, kFirstGated = 3, kGates = 3;
inline constexpr int kPlan[kLayers] = {0, 1, 2, 3, 2, 1, 0};  // the scale of each layer
inline constexpr int kPointFeatures = 28, kEdgeFeatures = 12, kOutputs = 2;
inline constexpr int kPointWords = kPointFeatures / 4, kEdgeWords = kEdgeFeatures / 4, kChannelWords = kChannels / 4;
inline constexpr int kSumShift = 6;     // from sums to activations
inline constexpr int kStoredShift = 3;  // from sums to what is kept of each neighbour, in 16 bits
inline constexpr float kSumStep = 1.0f / 2048;
inline constexpr float kClip = 4.0f;  // noises, of heights that gates weigh
inline constexpr float kLeast = 1e-30f, kLargest = 0x1.fffffep127f;

// How a value becomes a whole number from 0 to 127: floor(factor * value + offset + 1/2).
struct Coding {
  float factor, offset;
};
inline constexpr Coding kHeight{16, 64}, kSize{32, 0}, kShare{127, 0}, kSteepness{160, 0}, kSlope{64, 64},
    kSide{32, 64};

POINTFAIR_INLINE int truncated(float x) { return static_cast<int>(x); }

// NaN gives 0.
template <class F>
POINTFAIR_INLINE auto coded(F value, Coding by) {
  const F shifted = value * by.factor + (by.offset + 0.5f);
  return truncated(smaller(F(127.0f), larger(F(0.0f), shifted)));
}
// Four of them as the bytes of a word, the first lowest.
template <class I>
POINTFAIR_INLINE I word_of(I a, I b, I c, I d) {
  return a + (b << 8) + (c << 16) + (d << 24);
}

// What the net reads of a point. A normal may be zero.
struct Place {
  Vec3<float> classical, normal, measured;
  float noise;
};

// Others keep the place that the default run gave them.
POINTFAIR_INLINE bool can_move(const Place& here) {
  return here.noise > 0 && here.noise <= kLargest && squared_length(here.normal) > 0;
}

// Before the net reads them, points slide apart along the surface. In each of kSlides rounds neighbours push a point
// along its plane, each by its offset o in that plane times (1 - o^2 / m)^4, 0 beyond, where m is the mean of o^2; the
// point goes kSlide times the sum, at most kFarthestSlide noises away from where the default run put it.
inline constexpr int kSlides = 4;
inline constexpr float kSlide = 0.4f, kFarthestSlide = 1.0f;

template <class F>
POINTFAIR_INLINE Vec3<F> along_plane(Vec3<F> offset, Vec3<F> normal) {
  return offset - dot(offset, normal) * normal;
}
template <class F>
POINTFAIR_INLINE Vec3<F> push_of(Vec3<F> offset, F per_mean_square) {
  const F near = larger(F(0.0f), F(1.0f) - squared_length(offset) * per_mean_square), square = near * near;
  return (square * square) * offset;
}
POINTFAIR_INLINE float per_mean_square(float sum_of_squares) {
  return 1.0f / larger(sum_of_squares * (1.0f / kNeighbors), kLeast);
}
// The way of a point from where the default run put it, in noises.
POINTFAIR_INLINE Vec3<float> in_noises(const Place& start, Vec3<float> way) {
  return {way.x / start.noise, way.y / start.noise, way.z / start.noise};
}
POINTFAIR_INLINE Vec3<float> slid(const Place& start, Vec3<float> place, Vec3<float> pushes) {
  const Vec3<float> way = in_noises(start, (place - start.classical) - kSlide * pushes);
  const float length = square_root(squared_length(way));
  return start.classical + start.noise * ((kFarthestSlide / larger(length, kFarthestSlide)) * way);
}

// A neighbour, or a pack of them.
template <class F>
struct Neighbor {
  Vec3<F> classical, normal, measured;
  F noise;
};

// What of an edge also the point's own features and the gates read.
template <class F>
struct Edge {
  Vec3<F> offset, normal;  // to the neighbour; its normal, turned to the side of the point's own
  F square, height, its_height, raw_height, sine, turn;
};

template <class F>
POINTFAIR_INLINE Vec3<F> spread_of(Vec3<float> v) {
  return {F(v.x), F(v.y), F(v.z)};
}

template <class F>
POINTFAIR_INLINE Edge<F> edge_to(const Place& here, const Neighbor<F>& there) {
  Edge<F> e;
  const Vec3<F> normal = spread_of<F>(here.normal);
  e.offset = there.classical - spread_of<F>(here.classical);
  e.square = squared_length(e.offset);
  const F turn = dot(normal, there.normal);
  e.normal = select(turn < F(0.0f), Vec3<F>{-there.normal.x, -there.normal.y, -there.normal.z}, there.normal);
  e.turn = smaller(absolute(turn), F(1.0f));
  e.sine = square_root(larger(F(0.0f), F(1.0f) - e.turn * e.turn));
  e.height = dot(e.offset, normal);
  e.its_height = dot(e.offset, e.normal);
  e.raw_height = dot(there.measured - spread_of<F>(here.classical), normal);
  return e;
}

// The features of an edge in a neighbourhood of that size, as words.
template <class F, class I>
POINTFAIR_INLINE void edge_words(const Place& here, Vec3<float> side, float size, const Neighbor<F>& there,
                                 const Edge<F>& e, I* words) {
  const F noise = F(here.noise), per_noise = F(1.0f / here.noise), per_size = F(1.0f / size);
  const F its_back = dot(there.measured - there.classical, e.normal) / there.noise;
  words[0] = word_of(coded(e.square * per_size * per_size, kSize), coded(e.height * per_noise, kHeight),
                     coded(e.its_height * per_noise, kHeight), coded(e.height * per_size, kSlope));
  words[1] = word_of(coded(e.its_height * per_size, kSlope), coded(e.sine, kShare), coded(e.turn, kShare),
                     coded(there.noise / (there.noise + noise), kShare));
  words[2] = word_of(coded(its_back, kHeight), coded(e.raw_height * per_noise, kHeight),
                     coded(dot(e.offset, spread_of<F>(side)) * per_size, kSide),
                     coded(square_root(noise / (noise + square_root(e.square))), kShare));
}

// What gates weigh: along the neighbour's normal the heights of the point and of its measured place over the
// neighbour's plane, in noises.
template <class F>
POINTFAIR_INLINE F clipped(F height) {
  return smaller(F(kClip), larger(F(-kClip), height));
}
template <class F>
struct Pulls {
  F classical, measured;
};
template <class F>
POINTFAIR_INLINE Pulls<F> pulls_of(const Place& here, const Neighbor<F>& there, const Edge<F>& e) {
  const F per_noise = F(1.0f / here.noise);
  const F measured = dot(there.measured - spread_of<F>(here.classical), e.normal);
  return {clipped(e.its_height * per_noise), clipped(measured * per_noise)};
}

// Sums over the neighbours of one scale, in their order.
struct ScaleSums {
  Vec3<float> offset{};
  float square = 0, height = 0, squared_height = 0, sine = 0;
};
// Mean values; the size is the root of the mean squared distance.
struct Scale {
  Vec3<float> offset;
  float size, height, roughness, sine;
};
POINTFAIR_INLINE Scale scale_of(const ScaleSums& sums) {
  constexpr float kShareOfOne = 1.0f / kNeighbors;
  return {kShareOfOne * sums.offset, larger(square_root(sums.square * kShareOfOne), kLeast), sums.height * kShareOfOne,
          square_root(sums.squared_height * kShareOfOne), sums.sine * kShareOfOne};
}

// The normal on the side on which the neighbours lie, and the direction along the surface in which they do.
struct Sides {
  Vec3<float> up, side;
};
POINTFAIR_INLINE Sides sides_of(Vec3<float> normal, Vec3<float> offset) {
  const float height = dot(offset, normal);
  const Vec3<float> up = height < 0 ? Vec3<float>{-normal.x, -normal.y, -normal.z} : normal;
  const Vec3<float> across = offset - dot(offset, up) * up;
  const float length = square_root(squared_length(across));
  return {up, length > 0 ? Vec3<float>{across.x / length, across.y / length, across.z / length} : across};
}

// The features of a point whose normal is `up`, as words; heights of `scales` are over that normal's plane.
POINTFAIR_INLINE void point_words(const Place& here, const Scale* scales, int* words) {
  const float noise = here.noise;
  int features[kPointFeatures];
  int* next = features;
  for (int s = 0; s < kScales; ++s) {
    const Scale& scale = scales[s];
    const Vec3<float> across = scale.offset - scale.height * here.normal;
    *next++ = coded(scale.height / noise, kHeight);
    *next++ = coded(scale.roughness / noise, kSize);
    *next++ = coded(scale.roughness / scale.size, kSteepness);
    *next++ = coded(square_root(noise / (noise + scale.size)), kShare);
    *next++ = coded(scale.sine, kShare);
    *next++ = coded(square_root(squared_length(across)) / scale.size, kShare);
  }
  const Vec3<float> back = here.measured - here.classical;
  *next++ = coded(square_root(squared_length(back)) / noise, kSize);
  *next++ = coded(dot(back, here.normal) / noise, kHeight);
  *next++ = coded(scales[0].size / scales[1].size, kShare);
  *next++ = coded(scales[0].size / scales[3].size, kShare);
  for (int w = 0; w < kPointWords; ++w)
    words[w] = word_of(features[4 * w], features[4 * w + 1], features[4 * w + 2], features[4 * w + 3]);
}

// The weights as the arithmetic of a device takes them: word by word of the inputs, of each output the four weights of
// that word; of gates and outputs, rows of kChannels.
struct Layer {
  const signed char *own, *other, *edge, *update, *gate;  // gate: null where there is none
  const int *own_bias, *update_bias;
};
struct Weights {
  const signed char *input, *output;
  const int *input_bias, *output_bias;
  Layer layers[kLayers];
  float squared_trust;  // noises
};

// A way in noises: one longer than the trust becomes trust^2 over its length.
POINTFAIR_INLINE Vec3<float> trusted(Vec3<float> step, float squared_trust) {
  const float square = squared_length(step);
  return square > squared_trust ? (squared_trust / square) * step : step;
}

}  // namespace pointfair::point::net
