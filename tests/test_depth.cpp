// SPDX-License-Identifier: Apache-2.0
// Images of depth cameras: planes, jumps, pixels without a measurement, and the mean of pairs by a plain loop.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "pointfair/cloud.hpp"
#include "pointfair/depth.hpp"
#include "shapes.h"

namespace pointfair {
namespace {

constexpr std::size_t kWidth = 97, kHeight = 61;
using Depths = std::vector<float>;
using shapes::same_bits;

// 1 / depth of a plane is linear in the pixels. The right third is `step` farther.
Depths plane_with_jump(double step) {
  Depths depth;
  for (std::size_t y = 0; y < kHeight; ++y) {
    for (std::size_t x = 0; x < kWidth; ++x)
      depth.push_back(float(1 / (0.5 + 0.002 * double(x) - 0.001 * double(y)) + (x > 2 * kWidth / 3 ? step : 0)));
  }
  return depth;
}

Depths noisy(Depths depth, double sigma) {
  shapes::Random random(5);
  for (float& z : depth) z = float(1 / (1 / double(z) + sigma * random.normal()));
  return depth;
}

Depths denoised(const Depths& depth, unsigned threads = 0) {
  Depths out(depth.size());
  denoise_depth(depth, kWidth, out, threads);
  return out;
}

double mean_error(const Depths& a, const Depths& b, std::size_t first_column = 0, std::size_t last_column = kWidth) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    if (i % kWidth >= first_column && i % kWidth < last_column) sum += std::abs(double(a[i]) - b[i]);
  return sum / double(kHeight * (last_column - first_column));
}

// The same by plain loops over pixels in double precision (docs/how-it-works.md).
struct Reference {
  std::vector<double> w;  // NaN where nothing was measured

  double at(int y, int x) const {
    const bool inside = y >= 0 && x >= 0 && y < int(kHeight) && x < int(kWidth);
    return inside ? w[std::size_t(y) * kWidth + std::size_t(x)] : std::nan("");
  }
  double noise(int s) const {
    std::vector<double> all;
    for (int y = s; y < int(kHeight) - s; y += 2) {
      for (int x = s; x < int(kWidth) - s; x += 2) {
        const auto bend = [&](int column) { return at(y - s, column) + at(y + s, column) - 2 * at(y, column); };
        const double value = std::abs(bend(x - s) + bend(x + s) - 2 * bend(x)) / 6;
        if (!std::isnan(value)) all.push_back(value);
      }
    }
    std::sort(all.begin(), all.end());
    return all[all.size() * 3 / 5] / 0.841621;
  }
  void average(int s, double sigma) {
    const Reference before = *this;
    for (int y = 0; y < int(kHeight); ++y) {
      for (int x = 0; x < int(kWidth); ++x) {
        double moment = 0, sum = 0.5;
        for (int dy = 0; dy <= 2; ++dy) {
          for (int dx = -2; dx <= 2; ++dx) {
            if (dy == 0 && dx <= 0) continue;
            const double pair = before.at(y + dy * s, x + dx * s) + before.at(y - dy * s, x - dx * s);
            const double q = pair / 2 - before.at(y, x), near = 1 - q * q / (9 * sigma * sigma);
            if (!(near > 0)) continue;
            const double weight = std::exp(-(dy * dy + dx * dx) / (2 * 16 / 9.0)) * near * near;
            moment += weight * q;
            sum += weight;
          }
        }
        w[std::size_t(y) * kWidth + std::size_t(x)] += moment / sum;
      }
    }
  }
};

TEST(Depth, TheResultIsThatOfPlainLoops) {
  Depths depth = noisy(plane_with_jump(0.5), 0.002);
  depth[1234] = depth[2345] = 0;
  Reference reference;
  for (const float z : depth) reference.w.push_back(z == 0 ? std::nan("") : 1 / double(z));
  double most = 1e9;
  for (const int stride : {1, 2, 4, 8, 12}) {
    const double sigma = std::min(reference.noise(stride), most);
    reference.average(stride, sigma);
    most = 4 * sigma;
  }
  const Depths out = denoised(depth);
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (depth[i] == 0) continue;
    ASSERT_NEAR(1 / out[i], reference.w[i], 2e-6) << i;
  }
}

// Over wide strides, shape bends more than the noise of such an image can.
TEST(Depth, RipplesWithoutNoiseStay) {
  Depths clean;
  for (std::size_t y = 0; y < kHeight; ++y) {
    for (std::size_t x = 0; x < kWidth; ++x)
      clean.push_back(float(1 / (0.5 + 0.02 * std::sin(0.12 * double(x)) * std::sin(0.12 * double(y)))));
  }
  EXPECT_LT(mean_error(denoised(clean), clean), 0.002);
}

TEST(Depth, MostNoiseOfAPlaneGoes) {
  const Depths clean = plane_with_jump(0), before = noisy(clean, 0.002);
  EXPECT_LT(mean_error(denoised(before), clean), 0.25 * mean_error(before, clean));
}

TEST(Depth, AJumpStays) {
  const Depths clean = plane_with_jump(0.5), before = noisy(clean, 0.002);
  const std::size_t jump = 2 * kWidth / 3;
  EXPECT_LT(mean_error(denoised(before), clean, jump - 5, jump + 6),
            0.6 * mean_error(before, clean, jump - 5, jump + 6));
}

TEST(Depth, ACleanImageHardlyMoves) {
  const Depths clean = plane_with_jump(0.5);
  EXPECT_LT(mean_error(denoised(clean), clean), 1e-6);
}

TEST(Depth, PixelsWithoutAMeasurementKeepTheirBitsAndChangeNoOthersButByTheirAbsence) {
  Depths depth = noisy(plane_with_jump(0), 0.002);
  const float odd[] = {0, -0.0F, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(),
                       1e-45F};
  for (std::size_t i = 0; i < 5; ++i) depth[1000 + 7 * i] = odd[i];
  Depths all_nan = depth;
  for (std::size_t i = 0; i < 5; ++i) all_nan[1000 + 7 * i] = std::numeric_limits<float>::quiet_NaN();
  Depths out = denoised(depth);
  const Depths expected = denoised(all_nan);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(std::memcmp(&out[1000 + 7 * i], &odd[i], sizeof(float)), 0) << i;
    out[1000 + 7 * i] = expected[1000 + 7 * i];
  }
  EXPECT_TRUE(same_bits(out, expected));
}

TEST(Depth, ThreadsAndTheTargetChangeNoBit) {
  Depths depth = noisy(plane_with_jump(0.5), 0.002);
  const Depths expected = denoised(depth, 1);
  EXPECT_TRUE(same_bits(denoised(depth, 7), expected));
  denoise_depth(depth, kWidth, depth);
  EXPECT_TRUE(same_bits(depth, expected));
}

// A scene seen with z towards the camera, as in OpenGL, has the same result with the other sign.
TEST(Depth, TheSignOfDepthDoesNotMatter) {
  Depths depth = noisy(plane_with_jump(0.5), 0.002);
  const Depths expected = denoised(depth);
  for (float& z : depth) z = -z;
  Depths out = denoised(depth);
  for (float& z : out) z = -z;
  EXPECT_TRUE(same_bits(out, expected));
}

TEST(Depth, SmallImagesStay) {
  for (const std::size_t width : {1U, 2U, 5U}) {
    const Depths depth(2 * width, 1.5F);
    Depths out(depth.size());
    denoise_depth(depth, width, out);
    EXPECT_TRUE(same_bits(out, depth));
  }
  Depths none;
  denoise_depth(none, 0, none);
}

TEST(Depth, SizesThatMakeNoImageAreRefused) {
  const Depths depth(10);
  Depths out(10), short_out(9);
  EXPECT_THROW(denoise_depth(depth, 3, out), Error);
  EXPECT_THROW(denoise_depth(depth, 0, out), Error);
  EXPECT_THROW(denoise_depth(depth, 5, short_out), Error);
}

}  // namespace
}  // namespace pointfair
