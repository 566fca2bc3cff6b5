// SPDX-License-Identifier: Apache-2.0
// picture BEFORE AFTER OUT.png [AZIMUTH ELEVATION [ZOOM FOCUS_X FOCUS_Y]]: draws clouds side by side from one camera.
// Each point is a disc in its tangent plane; discs near the front surface blend their normals. The light is one lamp,
// a sky, and ambient occlusion measured in the depth image. The camera is orthographic, y is up, angles in degrees;
// the focus is in fractions of half the picture's height.
#include <png.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <limits>
#include <string>
#include <vector>

#include "pointfair/pointfair.hpp"

namespace {

using pointfair::Point;

constexpr int kPanelWidth = 800, kPanelHeight = 900;
constexpr int kSamples = 2;           // per pixel and axis
constexpr float kDiscRadius = 1.25f;  // in mean spacings: discs overlap without closing real gaps
constexpr int kNormalNeighbors = 20;
constexpr float kEmpty = -std::numeric_limits<float>::infinity();

struct Vec {
  float x = 0, y = 0, z = 0;
};
Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vec operator*(float s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
float dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec unit(Vec a) { return 1.0f / std::sqrt(std::max(dot(a, a), 1e-30f)) * a; }
Vec mix(Vec a, Vec b, float t) { return (1 - t) * a + t * b; }

// Points and normals of a cloud in world axes, and the length of a step between points.
struct Surface {
  std::vector<Vec> position, normal;
  float spacing = 0;
};

Surface make_surface(const pointfair::Cloud& cloud) {
  pointfair::Pipeline pipeline;
  pipeline.load(cloud);
  pointfair::Params params;
  params.k = kNormalNeighbors;
  params.passes = 1;
  pipeline.run(params);
  std::vector<Point> normals(cloud.points.size());
  pipeline.normals(normals);
  Surface surface;
  surface.spacing = float(pipeline.estimates().spacing);
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const Point p = cloud.points[i], n = normals[i];
    if (!std::isfinite(p.x + p.y + p.z) || (n.x == 0 && n.y == 0 && n.z == 0)) continue;
    const auto world = [&](int axis, float offset) { return float(cloud.origin[axis] + double(offset)); };
    surface.position.push_back({world(0, p.x), world(1, p.y), world(2, p.z)});
    surface.normal.push_back({n.x, n.y, n.z});
  }
  return surface;
}

// World to view: x right, y up, z toward the eye, the middle of the picture at 0, half its height 1.
struct Camera {
  Vec right, up, toward, center;
  float scale = 1, focus_x = 0, focus_y = 0;

  Vec turn(Vec v) const { return {dot(v, right), dot(v, up), dot(v, toward)}; }
  Vec view(Vec p) const {
    const Vec v = scale * turn(p + -1.0f * center);
    return {v.x - focus_x, v.y - focus_y, v.z};
  }
};

struct CameraOptions {
  float azimuth = 0, elevation = 0, zoom = 1, focus_x = 0, focus_y = 0;
};

Camera make_camera(const Surface& surface, CameraOptions options) {
  Camera camera;
  const float a = options.azimuth * 0.01745329f, e = options.elevation * 0.01745329f;
  camera.toward = {std::sin(a) * std::cos(e), std::sin(e), std::cos(a) * std::cos(e)};
  camera.right = {std::cos(a), 0, -std::sin(a)};
  camera.up = {-std::sin(a) * std::sin(e), std::cos(e), -std::cos(a) * std::sin(e)};
  Vec low{1e30f, 1e30f, 1e30f}, high = -1.0f * low;
  for (const Vec& p : surface.position) {
    const Vec v = camera.turn(p);
    low = {std::min(low.x, v.x), std::min(low.y, v.y), std::min(low.z, v.z)};
    high = {std::max(high.x, v.x), std::max(high.y, v.y), std::max(high.z, v.z)};
  }
  const Vec middle = 0.5f * (low + high);
  camera.center = middle.x * camera.right + middle.y * camera.up + middle.z * camera.toward;
  const float aspect = float(kPanelWidth) / kPanelHeight;
  camera.scale = options.zoom * 1.86f / std::max(high.y - low.y, (high.x - low.x) / aspect);
  camera.focus_x = options.focus_x * options.zoom;
  camera.focus_y = options.focus_y * options.zoom;
  return camera;
}

// What the rasteriser leaves: depth of the front surface and the blended normal of each sample.
struct Image {
  int width = kPanelWidth * kSamples, height = kPanelHeight * kSamples;
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

Image draw(const Surface& surface, const Camera& camera) {
  Image image;
  const float radius = kDiscRadius * surface.spacing * camera.scale;
  const auto for_each_disc = [&](auto cover_disc) {
    for (std::size_t i = 0; i < surface.position.size(); ++i) {
      Vec n = camera.turn(surface.normal[i]);
      if (n.z < 0) n = -1.0f * n;
      cover_disc(camera.view(surface.position[i]), n);
    }
  };
  for_each_disc([&](Vec center, Vec n) {
    rasterize(image, center, n, radius,
              [&](std::size_t s, float z, float) { image.depth[s] = std::max(image.depth[s], z); });
  });
  for_each_disc([&](Vec center, Vec n) {
    rasterize(image, center, n, radius, [&](std::size_t s, float z, float weight) {
      if (z > image.depth[s] - radius) image.normal[s] = image.normal[s] + weight * n;
    });
  });
  for (Vec& n : image.normal) n = unit(n);
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

Vec shade(const Image& image, int x, int y) {
  if (image.depth[image.at(x, y)] == kEmpty) return background(x, y, image);
  const Vec n = image.normal[image.at(x, y)];
  const Vec lamp = unit({-0.55f, 0.65f, 0.60f}), half = unit(lamp + Vec{0, 0, 1});
  const float diffuse = std::max(0.0f, dot(n, lamp));
  const float shine = std::pow(std::max(0.0f, dot(n, half)), 40.0f);
  const float rim = std::pow(1 - std::max(0.0f, n.z), 3.0f);
  const float open = 1 - occlusion(image, x, y);
  const Vec clay = {0.80f, 0.60f, 0.42f};
  const Vec sky = mix({0.28f, 0.22f, 0.20f}, {0.46f, 0.50f, 0.58f}, 0.5f + 0.5f * n.y);
  const Vec light = open * open * sky + (0.35f + 0.65f * open) * diffuse * Vec{0.92f, 0.88f, 0.80f};
  const Vec color = {clay.x * light.x, clay.y * light.y, clay.z * light.z};
  return color + (0.16f * shine * open + 0.10f * rim * open) * Vec{1, 1, 1};
}

void write_png(const std::string& path, const std::vector<unsigned char>& rgb, int width, int height) {
  png_image image{};
  image.version = PNG_IMAGE_VERSION;
  image.width = png_uint_32(width);
  image.height = png_uint_32(height);
  image.format = PNG_FORMAT_RGB;
  if (!png_image_write_to_file(&image, path.c_str(), 0, rgb.data(), 0, nullptr))
    throw pointfair::Error(pointfair::ErrorKind::file, path + ": " + image.message);
}

// Averages the samples of each pixel in linear light, then encodes for the screen.
void paint(const Image& image, std::vector<unsigned char>& rgb, int picture_width, int left) {
  for (int y = 0; y < kPanelHeight; ++y)
    for (int x = 0; x < kPanelWidth; ++x) {
      Vec sum;
      for (int s = 0; s < kSamples * kSamples; ++s)
        sum = sum + shade(image, x * kSamples + s % kSamples, y * kSamples + s / kSamples);
      const Vec mean = 1.0f / (kSamples * kSamples) * sum;
      unsigned char* out = &rgb[3 * (std::size_t(y) * picture_width + left + x)];
      for (const float value : {mean.x, mean.y, mean.z})
        *out++ = static_cast<unsigned char>(255 * std::pow(std::clamp(value, 0.0f, 1.0f), 1 / 1.6f) + 0.5f);
    }
}

void make_picture(const std::array<std::string, 2>& clouds, const std::string& out, CameraOptions options) {
  const std::array surfaces = {make_surface(pointfair::read(clouds[0])), make_surface(pointfair::read(clouds[1]))};
  const Camera camera = make_camera(surfaces[1], options);
  constexpr int kWidth = 2 * kPanelWidth;
  std::vector<unsigned char> rgb(std::size_t(3) * kWidth * kPanelHeight);
  for (int panel = 0; panel < 2; ++panel) paint(draw(surfaces[panel], camera), rgb, kWidth, panel * kPanelWidth);
  write_png(out, rgb, kWidth, kPanelHeight);
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 4 && argc != 6 && argc != 9) {
    std::cerr << "usage: picture BEFORE AFTER OUT.png [AZIMUTH ELEVATION [ZOOM FOCUS_X FOCUS_Y]]\n";
    return 2;
  }
  const auto number = [&](int i, float otherwise) { return argc > i ? std::stof(argv[i]) : otherwise; };
  make_picture({argv[1], argv[2]}, argv[3], {number(4, 0), number(5, 0), number(6, 1), number(7, 0), number(8, 0)});
  return 0;
} catch (const std::exception& error) {
  std::cerr << "picture: " << error.what() << '\n';
  return 1;
}
