// SPDX-License-Identifier: Apache-2.0
// Pictures of clouds for a page: points as squares, the nearest in front, shaded by the slope of what is seen.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "pointfair/cloud.hpp"

namespace pointfair::cli {

inline constexpr int kPictureWidth = 720, kPictureHeight = 440;  // pixels
inline constexpr std::uint32_t kNoPoint = 0xffffffffu;

/// Looks along one direction, without perspective. Lengths in file units, relative to the cloud's origin.
struct Camera {
  std::array<double, 3> right{1, 0, 0}, up{0, 1, 0}, toward{0, 0, 1};  ///< unit vectors; `toward` points to the viewer
  std::array<double, 3> centre{};                                      ///< the middle of the picture
  double pixels_per_unit = 1;
};

/// A camera that sees nearly all of the cloud (points far away may be left out): flat clouds obliquely from above,
/// others from the side and a little from above; the third coordinate is up. O(1): by a sample.
Camera overview(std::span<const Point> points);

/// The same direction, nearer: `width` file units wide, about the foremost point in the middle of the overview.
Camera detail(const Camera& overview, std::span<const Point> points, double width);

/// What a camera sees: of each pixel the foremost point, or kNoPoint, and how near it is, in pixels.
struct Seen {
  std::vector<std::uint32_t> point;
  std::vector<float> nearness;
};

/// Points as squares so large that points `spacing` apart touch. `stride`: only each so-many-th point. O(points).
Seen see(const Camera& camera, std::span<const Point> points, double spacing, std::size_t stride);

/// PNG of the surface in shades of one colour. O(pixels).
std::string shaded_png(const Seen& seen);

/// PNG of the surface in the colours of the map, by a value from 0 to 1 for each point (clamped; grey for NaN).
std::string mapped_png(const Seen& seen, const std::function<float(std::uint32_t point)>& value);

/// A point on a picture: its place as offset, and the number of its colour in kMarkColours.
struct Mark {
  Point place;
  std::size_t colour;
};
/// PNG of the surface in light grey, with all marks before it.
std::string marked_png(const Seen& seen, const Camera& camera, std::span<const Mark> marks);

/// CSS colours of marks, and of the map from 0 to 1, evenly spread.
inline constexpr std::array<const char*, 3> kMarkColours{"#c1121f", "#b35c00", "#1d4ed8"};
inline constexpr std::array<const char*, 5> kMapColours{"#440154", "#3b528b", "#21918c", "#5ec962", "#fde725"};

}  // namespace pointfair::cli
