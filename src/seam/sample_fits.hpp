// SPDX-License-Identifier: Apache-2.0
// What rows of nearest points show (point/sample.h), by fits on the host's cores. The kernels of every instruction set
// give the same bits, and those of a card, too.
#pragma once

#include "point/sample.h"

namespace pointfair {

// Each reads one row: three coordinates of each point.
struct SampleFits {
  // The rounds that a row of kFirstRow serves, and those after them, in a row of kLastRow.
  point::NoiseSample (*first_rounds)(const float* row, bool sheets);
  point::NoiseSample (*last_rounds)(const float* row, bool sheets);
  // Of a row of kFirstRow.
  point::ResidualSample (*residuals)(const float* row, bool sheets);
  // As Sampling::beyond_two(), of a row of kLastRow.
  double (*beyond_two)(const float* row, double sigma);
};

// Of the best instruction set that this processor has (src/cpu/dispatch.cpp).
const SampleFits& sample_fits();

}  // namespace pointfair
