// SPDX-License-Identifier: Apache-2.0
#include "drawing.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace picture {
namespace {

using pointfair::Point;

constexpr int kSamples = 2;           // per pixel and axis
constexpr float kDiscRadius = 1.25f;  // in mean spacings: discs overlap without closing real gaps
constexpr float kEmpty = -std::numeric_limits<float>::infinity();

Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vec operator*(float s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
float dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec unit(Vec a) { return 1.0f / std::sqrt(std::max(dot(a, a), 1e-30f)) * a; }
Vec mix(Vec a, Vec b, float t) { return (1 - t) * a + t * b; }

Vec position(const pointfair::Cloud& cloud, std::size_t i) {
  const Point p = cloud.points[i];
  const auto world = [&](int axis, float offset) { return float(cloud.origin[axis] + double(offset)); };
  return {world(0, p.x), world(1, p.y), world(2, p.z)};
}

// What the rasteriser leaves: depth of the front surface and the blended normal of each sample.
struct Image {
  explicit Image(PanelSize panel) : width(panel.width * kSamples), height(panel.height * kSamples) {}

  int width, height;
  std::vector<float> depth = std::vector<float>(std::size_t(width) * height, kEmpty);
  std::vector<Vec> normal = std::vector<Vec>(depth.size());
  float units_per_sample = 2.0f / float(height);

  bool inside(int x, int y) const { return x >= 0 && y >= 0 && x < width && y < height; }
  std::size_t at(int x, int y) const { return std::size_t(y) * width + x; }
};

// Calls `cover(sample, depth, weight)` for every sample under the disc.
template <class Cover>
void rasterize(const Image& image, Vec center, Vec normal, float radius, Cover cover) {
  const float half_height = float(image.height) / 2, half_width = float(image.width) / 2;
  const float x = half_width + center.x * half_height, y = half_height - center.y * half_height;
  const float reach = std::max(radius * half_height, 1.0f);
  const int first_x = std::max(0, int(x - reach)), last_x = std::min(image.width - 1, int(x + reach) + 1);
  const int first_y = std::max(0, int(y - reach)), last_y = std::min(image.height - 1, int(y + reach) + 1);
  const float steepest = std::max(normal.z, 0.25f);
  const float squared_radius = reach * reach / (half_height * half_height);
  for (int row = first_y; row <= last_y; ++row)
    for (int column = first_x; column <= last_x; ++column) {
      const float dx = (float(column) - x) / half_height, dy = (y - float(row)) / half_height;
      const float dz = -(normal.x * dx + normal.y * dy) / steepest;
      const float share = (dx * dx + dy * dy + dz * dz) / squared_radius;
      if (share < 1) cover(image.at(column, row), center.z + dz, (1 - share) * (1 - share));
    }
}

// Calls `cover_disc(center, normal)` for every point in view, its normal turned to the eye.
template <class Cover>
void for_each_disc(const Surface& surface, const Camera& camera, Cover cover_disc) {
  for (std::size_t i = 0; i < surface.position.size(); ++i) {
    const Vec n = camera.turn(surface.normal[i]);
    cover_disc(camera.view(surface.position[i]), n.z < 0 ? -1.0f * n : n);
  }
}

// Discs in their tangent planes; those near the front surface blend their normals.
Image draw_surface(const Surface& surface, const Camera& camera, PanelSize panel) {
  Image image(panel);
  const float radius = kDiscRadius * surface.spacing * camera.scale;
  for_each_disc(surface, camera, [&](Vec center, Vec n) {
    rasterize(image, center, n, radius,
              [&](std::size_t s, float z, float) { image.depth[s] = std::max(image.depth[s], z); });
  });
  for_each_disc(surface, camera, [&](Vec center, Vec n) {
    rasterize(image, center, n, radius, [&](std::size_t s, float z, float weight) {
      if (z > image.depth[s] - radius) image.normal[s] = image.normal[s] + weight * n;
    });
  });
  for (Vec& n : image.normal) n = unit(n);
  return image;
}

// Small discs that face the eye; each keeps its own normal, so that a wrong one among right ones shows.
Image draw_points(const Surface& surface, const Camera& camera, PanelSize panel, float spot_radius) {
  Image image(panel);
  const float radius = spot_radius * surface.spacing * camera.scale;
  for_each_disc(surface, camera, [&](Vec center, Vec n) {
    rasterize(image, center, {0, 0, 1}, radius, [&](std::size_t s, float z, float) {
      if (z <= image.depth[s]) return;
      image.depth[s] = z;
      image.normal[s] = n;
    });
  });
  return image;
}

// Share of the sky that surfaces nearby hide, from the depth image: for each direction and distance, how high the
// surface there rises above the tangent plane here. Things far in front cast no halo.
float occlusion(const Image& image, int x, int y) {
  constexpr int kDirections = 12, kSteps = 4;
  constexpr float kReach = 0.09f;  // of half the picture's height
  const Vec n = image.normal[image.at(x, y)];
  const float z = image.depth[image.at(x, y)];
  const float turn = float((x * 7 + y * 13) % 16) / 16;  // varied from sample to sample, so that no rings show
  float sum = 0;
  for (int d = 0; d < kDirections; ++d) {
    const float angle = 6.2831853f * (float(d) + turn) / kDirections;
    float horizon = 0;
    for (int s = 1; s <= kSteps; ++s) {
      const float distance = kReach * float(s * s) / (kSteps * kSteps);
      const float dx = distance * std::cos(angle), dy = distance * std::sin(angle);
      const int column = x + int(dx / image.units_per_sample), row = y - int(dy / image.units_per_sample);
      if (!image.inside(column, row) || image.depth[image.at(column, row)] == kEmpty) continue;
      const Vec there = {dx, dy, image.depth[image.at(column, row)] - z};
      const float length = std::sqrt(dot(there, there));
      const float fade = std::max(0.0f, 1 - length / (2 * kReach));
      horizon = std::max(horizon, fade * (dot(n, there) / length - 0.1f));
    }
    sum += horizon;
  }
  return std::min(1.0f, sum / kDirections);
}

Vec background(int x, int y, const Image& image) {
  const float u = float(x) / float(image.width) - 0.5f, v = float(y) / float(image.height) - 0.45f;
  return mix({0.965f, 0.970f, 0.978f}, {0.80f, 0.825f, 0.86f}, std::min(1.0f, 1.6f * (u * u + v * v)));
}

Vec clay(const Image& image, int x, int y) {
  const Vec n = image.normal[image.at(x, y)];
  const Vec lamp = unit({-0.55f, 0.65f, 0.60f}), half = unit(lamp + Vec{0, 0, 1});
  const float diffuse = std::max(0.0f, dot(n, lamp));
  const float shine = std::pow(std::max(0.0f, dot(n, half)), 40.0f);
  const float rim = std::pow(1 - std::max(0.0f, n.z), 3.0f);
  const float open = 1 - occlusion(image, x, y);
  const Vec albedo = {0.80f, 0.60f, 0.42f};
  const Vec sky = mix({0.28f, 0.22f, 0.20f}, {0.46f, 0.50f, 0.58f}, 0.5f + 0.5f * n.y);
  const Vec light = open * open * sky + (0.35f + 0.65f * open) * diffuse * Vec{0.92f, 0.88f, 0.80f};
  const Vec color = {albedo.x * light.x, albedo.y * light.y, albedo.z * light.z};
  return color + (0.16f * shine * open + 0.10f * rim * open) * Vec{1, 1, 1};
}

// The normal's direction, its sign left out, as a colour: across is red, upright is green, to the eye is blue.
Vec direction_color(Vec n) { return mix({0.3f, 0.3f, 0.3f}, {std::abs(n.x), std::abs(n.y), std::abs(n.z)}, 0.7f); }

// Averages the samples of each pixel in linear light, then encodes for the screen.
template <class Shade>
std::vector<unsigned char> paint(const Image& image, PanelSize panel, Shade shade) {
  std::vector<unsigned char> rgb;
  rgb.reserve(std::size_t(3) * panel.width * panel.height);
  for (int y = 0; y < panel.height; ++y)
    for (int x = 0; x < panel.width; ++x) {
      Vec sum;
      for (int s = 0; s < kSamples * kSamples; ++s) {
        const int column = x * kSamples + s % kSamples, row = y * kSamples + s / kSamples;
        const bool empty = image.depth[image.at(column, row)] == kEmpty;
        sum = sum + (empty ? background(column, row, image) : shade(column, row));
      }
      const Vec mean = 1.0f / (kSamples * kSamples) * sum;
      for (const float value : {mean.x, mean.y, mean.z})
        rgb.push_back(static_cast<unsigned char>(255 * std::pow(std::clamp(value, 0.0f, 1.0f), 1 / 1.6f) + 0.5f));
    }
  return rgb;
}

}  // namespace

Vec Camera::turn(Vec v) const { return {dot(v, right), dot(v, up), dot(v, toward)}; }

Vec Camera::view(Vec p) const {
  const Vec v = scale * turn(p + -1.0f * center);
  return {v.x - focus_x, v.y - focus_y, v.z};
}

Surface make_surface(const pointfair::Cloud& cloud, const pointfair::Params& params) {
  pointfair::Pipeline pipeline;
  pipeline.load(cloud);
  pipeline.run(params);
  std::vector<Point> normals(cloud.points.size());
  pipeline.normals(normals);
  Surface surface;
  surface.spacing = float(pipeline.estimates().spacing);
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const Point p = cloud.points[i], n = normals[i];
    if (!std::isfinite(p.x + p.y + p.z) || (n.x == 0 && n.y == 0 && n.z == 0)) continue;
    surface.position.push_back(position(cloud, i));
    surface.normal.push_back({n.x, n.y, n.z});
  }
  return surface;
}

Camera make_camera(const pointfair::Cloud& cloud, View view, PanelSize panel) {
  Camera camera;
  const float a = view.azimuth * 0.01745329f, e = view.elevation * 0.01745329f;
  camera.toward = {std::sin(a) * std::cos(e), std::sin(e), std::cos(a) * std::cos(e)};
  camera.right = {std::cos(a), 0, -std::sin(a)};
  camera.up = {-std::sin(a) * std::sin(e), std::cos(e), -std::cos(a) * std::sin(e)};
  Vec low{1e30f, 1e30f, 1e30f}, high = -1.0f * low;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    const Vec v = camera.turn(position(cloud, i));
    if (!std::isfinite(v.x + v.y + v.z)) continue;
    low = {std::min(low.x, v.x), std::min(low.y, v.y), std::min(low.z, v.z)};
    high = {std::max(high.x, v.x), std::max(high.y, v.y), std::max(high.z, v.z)};
  }
  const Vec middle = 0.5f * (low + high);
  camera.center = middle.x * camera.right + middle.y * camera.up + middle.z * camera.toward;
  const float aspect = float(panel.width) / float(panel.height);
  camera.scale = view.zoom * 1.86f / std::max(high.y - low.y, (high.x - low.x) / aspect);
  camera.focus_x = view.focus_x * view.zoom;
  camera.focus_y = view.focus_y * view.zoom;
  return camera;
}

std::vector<unsigned char> draw_clay(const Surface& surface, const Camera& camera, PanelSize panel) {
  const Image image = draw_surface(surface, camera, panel);
  return paint(image, panel, [&](int x, int y) { return clay(image, x, y); });
}

std::vector<unsigned char> draw_directions(const Surface& surface, const Camera& camera, PanelSize panel,
                                           float spot_radius) {
  const Image image = draw_points(surface, camera, panel, spot_radius);
  return paint(image, panel, [&](int x, int y) { return direction_color(image.normal[image.at(x, y)]); });
}

}  // namespace picture
