// SPDX-License-Identifier: Apache-2.0
// Clouds made on purpose: points sampled from a surface, noise, outliers. The same seed gives the same bytes on any
// machine and with any number of threads.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "pointfair/cloud.hpp"

namespace pointfair::cli {

using TriangleIndices = std::array<std::uint32_t, 3>;

/// `count` points drawn independently and uniformly by area. `ratio` above 1: the density grows geometrically by that
/// ratio from one end of the bounding box's longest axis to the other. Throws ErrorKind::failed if there is no area.
std::vector<Point> sample_surface(std::span<const Point> vertices, std::span<const TriangleIndices> triangles,
                                  std::uint64_t count, double ratio, std::uint64_t seed);

/// `count` points of a sphere with bumps of 5 % of its radius 1, in random order.
std::vector<Point> sample_bumpy_sphere(std::uint64_t count, std::uint64_t seed);

/// Adds isotropic Gaussian noise; points with NaN or infinity stay.
void add_noise(std::span<Point> points, double sigma, std::uint64_t seed);

/// Moves round(share * finite points) of the finite points, each choice of them alike, to places uniform in the
/// bounding box grown by 10 % about its centre.
void add_outliers(std::span<Point> points, double share, std::uint64_t seed);

/// Of the finite points; min above max if there is none.
struct Box {
  std::array<double, 3> min, max;
  double diagonal() const;
};
Box bounding_box(std::span<const Point> points);

}  // namespace pointfair::cli
