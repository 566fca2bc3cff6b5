// SPDX-License-Identifier: Apache-2.0
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "platform/many_threads.hpp"
#include "pointfair/cloud.hpp"
#include "pointfair/depth.hpp"

namespace pointfair {
namespace {

constexpr std::size_t kRows = 8;                                // a block
constexpr std::array<std::size_t, 5> kStrides{1, 2, 4, 8, 12};  // pixels between the pixels of a pair and its middle
constexpr float kOwnWeight = 0.5F, kReach = 3;                  // in noises
constexpr std::size_t kFewest = 100;                            // values that say how much noise there is
constexpr float kGrowth = 4;                                    // of the noise from stride to stride; more is shape

// The pixels of a pair lie at (y + dy, x + dx) and (y - dy, x - dx), in strides. The weights fall as a Gaussian whose
// sigma is 4/3.
struct Pair {
  int dy, dx;
  float weight;
};
constexpr float kWeights[] = {0, 0.754840F, 0.569783F, 0, 0.324652F, 0.245061F, 0, 0, 0.105399F};  // by dx^2 + dy^2
constexpr std::array<Pair, 12> kPairs{{{0, 1, kWeights[1]},
                                       {0, 2, kWeights[4]},
                                       {1, -2, kWeights[5]},
                                       {1, -1, kWeights[2]},
                                       {1, 0, kWeights[1]},
                                       {1, 1, kWeights[2]},
                                       {1, 2, kWeights[5]},
                                       {2, -2, kWeights[8]},
                                       {2, -1, kWeights[5]},
                                       {2, 0, kWeights[4]},
                                       {2, 1, kWeights[5]},
                                       {2, 2, kWeights[8]}}};

// Of 1 / depth; NaN where nothing was measured.
struct Image {
  std::size_t width, height;
  std::vector<float> values;

  const float* row(std::size_t y) const { return values.data() + y * width; }
  float* row(std::size_t y) { return values.data() + y * width; }
};

template <class Body>
void for_rows(std::size_t height, const std::stop_token& stop, const Body& body) {
  const std::size_t blocks = (height + kRows - 1) / kRows;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, blocks, 1), [&](const tbb::blocked_range<std::size_t>& range) {
    if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
    for (std::size_t y = range.begin() * kRows; y < std::min(height, range.end() * kRows); ++y) body(y);
  });
}

// Differences of a row that neither a slope nor a bend along rows or columns changes: the noise of one pixel, of pixels
// whose noise is independent. Every other pixel of every other row is enough.
void append_differences(const Image& image, std::size_t y, std::size_t stride, std::vector<float>& out) {
  const float *up = image.row(y - stride), *here = image.row(y), *down = image.row(y + stride);
  const auto bend = [&](std::size_t x) { return up[x] + down[x] - 2 * here[x]; };
  for (std::size_t x = stride; x + stride < image.width; x += 2) {
    const float difference = std::abs(bend(x - stride) + bend(x + stride) - 2 * bend(x)) / 6;
    if (difference <= std::numeric_limits<float>::max()) out.push_back(difference);
  }
}

// The standard deviation of the noise between pixels so far apart, from the 60 % quantile, which jumps do not reach.
float noise_at(const Image& image, std::size_t stride, const std::stop_token& stop) {
  if (image.height <= 2 * stride || image.width <= 2 * stride) return 0;
  std::vector<std::vector<float>> rows((image.height - 2 * stride + 1) / 2);
  for_rows(rows.size(), stop, [&](std::size_t i) { append_differences(image, stride + 2 * i, stride, rows[i]); });
  std::vector<float> all;
  for (const std::vector<float>& row : rows) all.insert(all.end(), row.begin(), row.end());
  if (all.size() < kFewest) return 0;
  const auto quantile = all.begin() + std::ptrdiff_t(all.size() * 3 / 5);
  std::nth_element(all.begin(), quantile, all.end());
  return *quantile / 0.841621F;
}

// Adds, for `count` pixels, what their pairs say: its weight falls to zero where the pair's mean is off by the reach.
void add_pairs(const float* here, const float* one, const float* other, std::size_t count, float weight,
               float per_square, float* moment, float* sum) {
  for (std::size_t i = 0; i < count; ++i) {
    const float off = 0.5F * (one[i] + other[i]) - here[i], near = 1 - off * off * per_square;
    const bool counts = near > 0;  // false for NaN
    const float w = counts ? weight * near * near : 0;
    moment[i] += counts ? w * off : 0;
    sum[i] += w;
  }
}

void average_row(const Image& image, std::size_t y, std::size_t stride, float noise, float* out) {
  const std::size_t width = image.width;
  const float reach = kReach * noise, per_square = 1 / (reach * reach);
  std::vector<float> moment(width), sum(width, kOwnWeight);
  for (const Pair& pair : kPairs) {
    const std::size_t dy = std::size_t(pair.dy) * stride, dx = std::size_t(std::abs(pair.dx)) * stride;
    if (y < dy || y + dy >= image.height || width <= 2 * dx) continue;
    const float *below = image.row(y + dy), *above = image.row(y - dy);
    const float *right = pair.dx < 0 ? above : below, *left = pair.dx < 0 ? below : above;
    add_pairs(image.row(y) + dx, right + 2 * dx, left, width - 2 * dx, pair.weight, per_square, moment.data() + dx,
              sum.data() + dx);
  }
  for (std::size_t x = 0; x < width; ++x) out[x] = image.row(y)[x] + moment[x] / sum[x];
}

Image inverse(std::span<const float> depth, std::size_t width) {
  Image image{width, depth.size() / width, std::vector<float>(depth.size())};
  std::ranges::transform(depth, image.values.begin(), [](float z) {
    const float inverse = 1 / z;
    return std::isfinite(z) && std::isfinite(inverse) ? inverse : std::numeric_limits<float>::quiet_NaN();
  });
  return image;
}

void denoise_image(std::span<const float> depth, std::size_t width, std::span<float> out, const std::stop_token& stop) {
  Image image = inverse(depth, width);
  const Image before = image;
  Image next = image;
  float most = std::numeric_limits<float>::max();
  for (const std::size_t stride : kStrides) {
    const float noise = std::min(noise_at(image, stride, stop), most), square = kReach * noise * kReach * noise;
    if (!std::isnormal(square)) continue;
    most = kGrowth * noise;
    for_rows(image.height, stop, [&](std::size_t y) { average_row(image, y, stride, noise, next.row(y)); });
    std::swap(image, next);
  }
  for (std::size_t i = 0; i < depth.size(); ++i) {
    const float moved = 1 / image.values[i];
    const bool keeps = std::isnan(image.values[i]) || image.values[i] == before.values[i] || !std::isfinite(moved);
    out[i] = keeps ? depth[i] : moved;
  }
}

}  // namespace

void denoise_depth(std::span<const float> depth, std::size_t width, std::span<float> out, unsigned threads,
                   std::stop_token stop) {
  if (width == 0 ? !depth.empty() : depth.size() % width != 0)
    throw Error(ErrorKind::usage, "depth has " + std::to_string(depth.size()) + " pixels, which are no rows of " +
                                      std::to_string(width) + ": give whole rows");
  if (out.size() != depth.size())
    throw Error(ErrorKind::usage, "out has " + std::to_string(out.size()) + " pixels, depth " +
                                      std::to_string(depth.size()) + ": they must agree");
  if (depth.empty()) return;
  platform::allow_many_threads();
  tbb::task_arena arena(threads == 0 ? tbb::task_arena::automatic : int(threads));
  arena.execute([&] { denoise_image(depth, width, out, stop); });
}

}  // namespace pointfair
