// SPDX-License-Identifier: Apache-2.0
#include "picture.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <numbers>
#include <string_view>

#include "png.hpp"

namespace pointfair::cli {
namespace {

using Vector = std::array<double, 3>;

constexpr std::size_t kPixels = std::size_t{kPictureWidth} * kPictureHeight;
constexpr std::size_t kSampled = 50'000;  // points that place a camera
constexpr float kNothing = -std::numeric_limits<float>::infinity();
constexpr int kShades = 16, kMapSteps = 15;  // together at most 256 colours
constexpr double kClosed = 1.7;              // spacings across a square: random points leave hardly a gap then
constexpr int kMarkSide = 7;                 // pixels
constexpr int kLargestSquare = 64;           // pixels

double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vector as_vector(const Point& p) { return {p.x, p.y, p.z}; }

std::vector<Point> sampled(std::span<const Point> points) {
  std::vector<Point> sample;
  const std::size_t stride = std::max<std::size_t>(1, points.size() / kSampled);
  for (std::size_t i = 0; i < points.size(); i += stride)
    if (is_finite(points[i])) sample.push_back(points[i]);
  return sample;
}

// The values between which all but 0.5 % at either end lie along a direction.
std::pair<double, double> extent(std::span<const Point> sample, const Vector& direction) {
  std::vector<double> along;
  for (const Point& p : sample) along.push_back(dot(direction, as_vector(p)));
  const auto tail = static_cast<std::ptrdiff_t>(along.size() / 200);
  std::nth_element(along.begin(), along.begin() + tail, along.end());
  const double low = along[static_cast<std::size_t>(tail)];
  std::nth_element(along.begin(), along.end() - 1 - tail, along.end());
  return {low, *(along.end() - 1 - tail)};
}

void turn(Camera& camera, double azimuth_degrees, double elevation_degrees) {
  const double azimuth = azimuth_degrees * std::numbers::pi / 180,
               elevation = elevation_degrees * std::numbers::pi / 180;
  camera.toward = {std::cos(elevation) * std::cos(azimuth), std::cos(elevation) * std::sin(azimuth),
                   std::sin(elevation)};
  camera.right = {-std::sin(azimuth), std::cos(azimuth), 0};
  camera.up = {-std::sin(elevation) * std::cos(azimuth), -std::sin(elevation) * std::sin(azimuth), std::cos(elevation)};
}

// Where a point appears: pixels from the left and from the top, and how near it is, in pixels too.
struct Place {
  double x, y, near;
};
Place place_of(const Camera& camera, const Point& p) {
  const Vector v{p.x - camera.centre[0], p.y - camera.centre[1], p.z - camera.centre[2]};
  return {kPictureWidth / 2.0 + camera.pixels_per_unit * dot(camera.right, v),
          kPictureHeight / 2.0 - camera.pixels_per_unit * dot(camera.up, v),
          camera.pixels_per_unit * dot(camera.toward, v)};
}

// std::floor is a call where processors need have no instruction for it.
int floor_of(double value) {
  const int whole = static_cast<int>(value);
  return whole - (value < whole);
}

// Calls `set` with each pixel of a square about the place.
template <class Set>
void for_square(const Place& at, int side, const Set& set) {
  if (!(std::abs(at.x) < 1e6 && std::abs(at.y) < 1e6)) return;
  const int left = floor_of(at.x) - side / 2, top = floor_of(at.y) - side / 2;
  for (int y = std::max(0, top); y < std::min(kPictureHeight, top + side); ++y)
    for (int x = std::max(0, left); x < std::min(kPictureWidth, left + side); ++x)
      set(static_cast<std::size_t>(y) * kPictureWidth + static_cast<std::size_t>(x));
}

// Means over the pixels around that belong to the same surface, so that squares do not show.
std::vector<float> smoothed(const std::vector<float>& nearness) {
  constexpr float kSameSurface = 6;  // pixels
  std::vector<float> result = nearness;
  for (int y = 1; y + 1 < kPictureHeight; ++y) {
    for (int x = 1; x + 1 < kPictureWidth; ++x) {
      const std::size_t i = static_cast<std::size_t>(y * kPictureWidth + x);
      if (nearness[i] == kNothing) continue;
      float sum = 0, count = 0;
      for (const int row : {-kPictureWidth, 0, kPictureWidth}) {
        for (const int column : {-1, 0, 1}) {
          const float other = nearness[static_cast<std::size_t>(static_cast<int>(i) + row + column)];
          if (!(std::abs(other - nearness[i]) < kSameSurface)) continue;
          sum += other;
          ++count;
        }
      }
      result[i] = sum / count;
    }
  }
  return result;
}

// From 0 to kShades - 1, by a light from the upper left.
std::vector<std::uint8_t> shades_of(const Seen& seen) {
  constexpr float kSteepest = 4, kAmbient = 0.3f;
  const std::vector<float> near = smoothed(smoothed(seen.nearness));
  std::vector<std::uint8_t> shades(kPixels);
  const auto slope = [&](std::size_t before, std::size_t after) {
    const float rise = near[after] - near[before];
    return std::isfinite(rise) ? std::clamp(rise / 2, -kSteepest, kSteepest) : 0.0f;
  };
  for (std::size_t y = 1; y + 1 < kPictureHeight; ++y) {
    for (std::size_t x = 1; x + 1 < kPictureWidth; ++x) {
      const std::size_t i = y * kPictureWidth + x;
      if (seen.point[i] == kNoPoint) continue;
      const float across = slope(i - 1, i + 1), down = slope(i - kPictureWidth, i + kPictureWidth);
      const float light = (0.4f * across + 0.5f * down + 0.77f) / std::sqrt(across * across + down * down + 1);
      const float shade = kAmbient + (1 - kAmbient) * std::clamp(light, 0.0f, 1.0f);
      shades[i] = static_cast<std::uint8_t>(shade * (kShades - 1) + 0.5f);
    }
  }
  return shades;
}

Rgb rgb_of(std::string_view css) {
  Rgb rgb{};
  for (std::size_t i = 0; i < 3; ++i) std::from_chars(&css[1 + 2 * i], &css[3 + 2 * i], rgb[i], 16);
  return rgb;
}

Rgb between(const Rgb& a, const Rgb& b, double share) {
  Rgb result{};
  for (std::size_t i = 0; i < 3; ++i) result[i] = static_cast<std::uint8_t>(std::lround(a[i] + share * (b[i] - a[i])));
  return result;
}

constexpr Rgb kBlack{0, 0, 0}, kWhite{255, 255, 255}, kGrey{150, 150, 150};

// White, then the shades of each colour.
std::vector<Rgb> palette_of(const std::vector<Rgb>& colours) {
  std::vector<Rgb> palette{kWhite};
  for (const Rgb& colour : colours)
    for (int shade = 0; shade < kShades; ++shade) palette.push_back(between(kBlack, colour, shade / (kShades - 1.0)));
  return palette;
}

std::uint8_t pixel_of(std::size_t colour, std::uint8_t shade) {
  return static_cast<std::uint8_t>(1 + colour * kShades + shade);
}

// White where nothing is seen. of_point(point, shade) elsewhere.
template <class OfPoint>
std::vector<std::uint8_t> pixels_of(const Seen& seen, const OfPoint& of_point) {
  const std::vector<std::uint8_t> shades = shades_of(seen);
  std::vector<std::uint8_t> pixels(kPixels);
  for (std::size_t i = 0; i < kPixels; ++i)
    if (seen.point[i] != kNoPoint) pixels[i] = of_point(seen.point[i], shades[i]);
  return pixels;
}

std::vector<std::uint8_t> shaded(const Seen& seen) {
  return pixels_of(seen, [](std::uint32_t, std::uint8_t shade) { return pixel_of(0, shade); });
}

}  // namespace

Camera overview(std::span<const Point> points) {
  Camera camera;
  const std::vector<Point> sample = sampled(points);
  if (sample.empty()) return camera;
  const auto [left, right] = extent(sample, {1, 0, 0});
  const auto [front, back] = extent(sample, {0, 1, 0});
  const auto [low, high] = extent(sample, {0, 0, 1});
  const bool is_flat = high - low < std::max(right - left, back - front) / 4;
  turn(camera, -60, is_flat ? 50 : 20);
  const auto [west, east] = extent(sample, camera.right);
  const auto [south, north] = extent(sample, camera.up);
  const double middle = dot(camera.toward, {(left + right) / 2, (front + back) / 2, (low + high) / 2});
  for (std::size_t axis = 0; axis < 3; ++axis)
    camera.centre[axis] =
        camera.right[axis] * (west + east) / 2 + camera.up[axis] * (south + north) / 2 + camera.toward[axis] * middle;
  const double units = std::max((east - west) / kPictureWidth, (north - south) / kPictureHeight);
  if (units > 0) camera.pixels_per_unit = 0.94 / units;
  return camera;
}

Camera detail(const Camera& overview, std::span<const Point> points, double width) {
  Camera camera = overview;
  if (!(width > 0)) return camera;
  camera.pixels_per_unit = kPictureWidth / width;
  double best = -std::numeric_limits<double>::infinity();
  for (const Point& p : sampled(points)) {
    const Place at = place_of(overview, p);
    const double off = std::hypot(at.x - kPictureWidth / 2.0, at.y - kPictureHeight / 2.0);
    if (!(at.near - 20 * off > best)) continue;  // being in the middle counts more than being near
    best = at.near - 20 * off;
    camera.centre = as_vector(p);
  }
  return camera;
}

Seen see(const Camera& camera, std::span<const Point> points, double spacing, std::size_t stride) {
  Seen seen{std::vector<std::uint32_t>(kPixels, kNoPoint), std::vector<float>(kPixels, kNothing)};
  const double side = kClosed * spacing * std::sqrt(static_cast<double>(stride)) * camera.pixels_per_unit;
  const int square = static_cast<int>(std::clamp(std::ceil(side), 1.0, double{kLargestSquare}));
  for (std::size_t i = 0; i < points.size(); i += stride) {
    if (!is_finite(points[i])) continue;
    const Place at = place_of(camera, points[i]);
    const auto near = static_cast<float>(at.near);
    for_square(at, square, [&](std::size_t pixel) {
      if (!(near > seen.nearness[pixel])) return;
      seen.nearness[pixel] = near;
      seen.point[pixel] = static_cast<std::uint32_t>(i);
    });
  }
  return seen;
}

std::string shaded_png(const Seen& seen) { return png_of(shaded(seen), kPictureWidth, palette_of({{228, 224, 216}})); }

std::string mapped_png(const Seen& seen, const std::function<float(std::uint32_t point)>& value) {
  constexpr int kOfMap = kMapSteps - 1;  // the last colour is grey
  std::vector<Rgb> colours;
  for (int step = 0; step < kOfMap; ++step) {
    const double place = step / (kOfMap - 1.0) * (kMapColours.size() - 1);
    const auto below = std::min<std::size_t>(static_cast<std::size_t>(place), kMapColours.size() - 2);
    colours.push_back(between(rgb_of(kMapColours[below]), rgb_of(kMapColours[below + 1]), place - double(below)));
  }
  colours.push_back(kGrey);
  const auto of_point = [&](std::uint32_t point, std::uint8_t shade) {
    const float share = value(point);
    const int step = std::isnan(share) ? kOfMap : static_cast<int>(std::clamp(share, 0.0f, 1.0f) * (kOfMap - 1) + 0.5f);
    // colours tell values, so that shades are weak
    return pixel_of(static_cast<std::size_t>(step), static_cast<std::uint8_t>((kShades + shade) / 2));
  };
  return png_of(pixels_of(seen, of_point), kPictureWidth, palette_of(colours));
}

std::string marked_png(const Seen& seen, const Camera& camera, std::span<const Mark> marks) {
  std::vector<Rgb> colours{{225, 225, 222}};
  for (const char* colour : kMarkColours) colours.push_back(rgb_of(colour));
  std::vector<std::uint8_t> pixels = shaded(seen);
  for (const Mark& mark : marks)
    for_square(place_of(camera, mark.place), kMarkSide,
               [&](std::size_t pixel) { pixels[pixel] = pixel_of(1 + mark.colour, kShades - 1); });
  return png_of(pixels, kPictureWidth, palette_of(colours));
}

}  // namespace pointfair::cli
