// SPDX-License-Identifier: Apache-2.0
// Fits of rows of nearest points: one thread works for all lanes of a team, in loops over strides that the compiler
// turns into vectors without changing the order of any sum. Part of src/cpu/kernels.cpp.
#pragma once

#include "point/sample.h"

namespace pointfair::cpu::POINTFAIR_ISA {

struct OneThread {
  template <class Body>
  POINTFAIR_INLINE void for_each(int count, const Body& body) const {
    for (int i = 0; i < count; ++i) body(i);
  }

  template <int N>
  class Sums {
   public:
    POINTFAIR_INLINE explicit Sums(OneThread) {}
    template <class TermsOf>
    POINTFAIR_INLINE void add(int first, int end, const TermsOf& terms_of) {
      for (int i = first; i < end;) {
        const int stride = i % point::kStrides, left = end - i, strides = point::kStrides - stride;
        const int count = strides < left ? strides : left;
        for (int s = 0; s < count; ++s) {
          const point::Terms<N> terms = terms_of(i + s);
          point::for_constants<N>([&](auto n) { partial_[n.value][stride + s] += terms.of[n.value]; });
        }
        i += count;
      }
    }
    POINTFAIR_INLINE point::Terms<N> total() const {
      point::Terms<N> total;
      for (int n = 0; n < N; ++n) {
        double sums[point::kStrides];
        for (int s = 0; s < point::kStrides; ++s) sums[s] = partial_[n][s];
        for (int half = point::kStrides / 2; half > 0; half /= 2)
          for (int s = 0; s < half; ++s) sums[s] += sums[s + half];
        total.of[n] = sums[0];
      }
      return total;
    }

   private:
    double partial_[N][point::kStrides] = {};
  };
};

// Three coordinates of each point.
class SampleRow {
 public:
  POINTFAIR_INLINE explicit SampleRow(const float* xyz) : xyz_(xyz) {}
  POINTFAIR_INLINE point::Vec3<float> operator[](int i) const {
    return {xyz_[3 * i], xyz_[3 * i + 1], xyz_[3 * i + 2]};
  }

 private:
  const float* xyz_;
};

// By the neighbourhoods of some rounds, in a row of kMost.
template <int kMost, int kFirstRound, int kEndRound>
static point::NoiseSample noise_of_rounds(const float* row, bool sheets) {
  point::FitSpace<kMost> space;
  const point::RowTaken taken = point::take_row(OneThread{}, space, SampleRow(row));
  point::GrowingNeighborhood neighborhood(OneThread{}, space, sheets);
  return point::noise_sample(kFirstRound, kEndRound, [&](int round) {
    return point::look_at(neighborhood, taken, point::points_of(round), false);
  });
}

static point::ResidualSample residuals_of(const float* row, bool sheets) {
  point::FitSpace<point::kFirstRow> space;
  const point::RowTaken taken = point::take_row(OneThread{}, space, SampleRow(row));
  point::GrowingNeighborhood neighborhood(OneThread{}, space, sheets);
  constexpr int kSizes[] = {point::kLeastFit, point::kFirstFit, 2 * point::kFirstFit, point::kFirstRow};
  point::Look looks[4];
  for (int i = 0; i < 4; ++i) looks[i] = point::look_at(neighborhood, taken, kSizes[i], true);
  return point::residual_sample(looks[0], looks[1], looks[2], looks[3],
                                point::plane_sample(OneThread{}, space, taken.there));
}

static double beyond_two_sigmas(const float* row, double sigma) {
  constexpr double kWithin = 7;  // sigmas; a narrower sphere cuts the farthest heights off
  point::FitSpace<point::kLastRow> space;
  const int there = point::take_row(OneThread{}, space, SampleRow(row)).there;
  int count = there < point::kFirstRow ? there : point::kFirstRow;
  while (count < there && point::length(space.offset(count)) <= kWithin * sigma) ++count;
  point::GrowingNeighborhood neighborhood(OneThread{}, space, false);
  neighborhood.grow_to(count);
  if (!neighborhood.shows_a_surface() || neighborhood.gap() > 0) return -1;
  neighborhood.noise();
  return neighborhood.beyond_two();
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
