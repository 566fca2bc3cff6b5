// SPDX-License-Identifier: Apache-2.0
#include "estimate/shared_error.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "estimate/constants.hpp"

namespace pointfair {
namespace {

using namespace constants;

// Of a typical place, by neighbourhoods of one size; 0 where none shows any.
double typical(const std::vector<point::ResidualSample>& residuals, double point::ResidualSample::*size) {
  std::vector<double> known;
  for (const point::ResidualSample& sample : residuals)
    if (sample.*size >= 0) known.push_back(sample.*size);
  if (known.empty()) return 0;
  const auto place = known.begin() + std::ptrdiff_t(kNoiseQuantile * double(known.size() - 1));
  std::nth_element(known.begin(), place, known.end());
  return *place;
}

}  // namespace

bool residuals_jump(const std::vector<point::ResidualSample>& residuals) {
  const double least = typical(residuals, &point::ResidualSample::least),
               narrow = typical(residuals, &point::ResidualSample::narrow),
               wide = typical(residuals, &point::ResidualSample::wide),
               widest = typical(residuals, &point::ResidualSample::widest);
  return wide > kJump * narrow || widest > kJump * wide || narrow > kFirstJump * least;
}

bool residuals_stay(const std::vector<point::ResidualSample>& thinned, double spacing) {
  const double wide = typical(thinned, &point::ResidualSample::wide),
               widest = typical(thinned, &point::ResidualSample::widest);
  return wide > kTrustedNoise * spacing && widest > 0 && widest < kStay * wide;
}

}  // namespace pointfair
