// SPDX-License-Identifier: Apache-2.0
// Loops over doubles for the fields between samples, one thing each, so that compilers make vectors of them. Part of
// src/cpu/kernels.cpp.
#pragma once

#include "point/exponential.h"
#include "seam/sample_fits.hpp"

namespace pointfair::cpu::POINTFAIR_ISA {

static double mean_said(const CurveModels& models, const double* pull) {
  constexpr double kNextToNone = -690;  // its exponential is lost beside the best one's, which is 1
  constexpr std::size_t kAbreast = 8;
  const std::size_t count = models.count;
  double of[CurveModels::kMost];  // misfits, then likelihoods
  for (std::size_t n = 0; n < count; ++n) of[n] = models.misfit[n];
  for (std::size_t v = 0; v < CurveModels::kValues; ++v)
    for (std::size_t n = 0; n < count; ++n) of[n] -= pull[v] * models.logs[v][n];
  double least[kAbreast];
  for (std::size_t i = 0; i < kAbreast; ++i) least[i] = of[0];
  std::size_t first = 0;
  for (; first + kAbreast <= count; first += kAbreast)
    for (std::size_t i = 0; i < kAbreast; ++i) least[i] = of[first + i] < least[i] ? of[first + i] : least[i];
  double best = of[0];
  for (std::size_t i = 0; i < kAbreast; ++i) best = least[i] < best ? least[i] : best;
  for (; first < count; ++first) best = of[first] < best ? of[first] : best;
  for (std::size_t n = 0; n < count; ++n) {
    const double log_likelihood = -0.5 * (of[n] - best);
    of[n] = log_likelihood < kNextToNone ? kNextToNone : log_likelihood;
  }
  for (std::size_t n = 0; n < count; ++n) of[n] = point::exp_within_700(of[n]);
  double sum = 0, all = 0;
  for (std::size_t n = 0; n < count; ++n) {
    sum += of[n] * models.said[n];
    all += of[n];
  }
  return sum / all;
}

static void exponentials(const double* x, std::size_t count, float* out) {
  for (std::size_t i = 0; i < count; ++i) out[i] = float(point::exp_within_700(x[i]));
}

}  // namespace pointfair::cpu::POINTFAIR_ISA
