// SPDX-License-Identifier: Apache-2.0
// Images of depth cameras: planes, jumps, pixels without a measurement, and the mean of pairs by a plain loop.
#include <gtest/gtest.h>

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

bool same_bits(const Depths& a, const Depths& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
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
