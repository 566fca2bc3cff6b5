// SPDX-License-Identifier: Apache-2.0
// What rows of nearest points show (point/sample.h), by fits on the host's cores, and what is made of it. The kernels
// of every instruction set give the same bits; a card's fits give them, too.
#pragma once

#include <cstddef>

#include "point/sample.h"

namespace pointfair {

// Models of a curve of values, each with a likelihood of exp(-misfit / 2) and one number that it says. The misfit of
// model n is misfit[n] - sum pull[v] * logs[v][n], over the values v of one curve.
struct CurveModels {
  static constexpr std::size_t kMost = 128, kValues = 4;
  std::size_t count;  // kMost at most
  const double *misfit, *logs[kValues], *said;
};

// Each reads one row: three coordinates of each point.
struct SampleFits {
  // The rounds that a row of kFirstRow serves, and those after them, in a row of kLastRow.
  point::NoiseSample (*first_rounds)(const float* row, bool sheets);
  point::NoiseSample (*last_rounds)(const float* row, bool sheets);
  // Of a row of kFirstRow.
  point::ResidualSample (*residuals)(const float* row, bool sheets);
  // As Sampling::beyond_two(), of a row of kLastRow.
  double (*beyond_two)(const float* row, double sigma);
  // The mean of what the models say, by their likelihoods.
  double (*mean_said)(const CurveModels&, const double* pull);
  // exp() of `count` numbers between -700 and 700.
  void (*exponentials)(const double* x, std::size_t count, float* out);
};

// Of the best instruction set that this processor has (src/cpu/dispatch.cpp).
const SampleFits& sample_fits();

}  // namespace pointfair
