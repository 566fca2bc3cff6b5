// SPDX-License-Identifier: Apache-2.0
#include "surface.hpp"

#include <embree3/rtcore.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "pointfair/cloud.hpp"

namespace pointfair::cli {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

float below(double value) { return std::nextafter(static_cast<float>(value), -kInfinity); }
float above(double value) { return std::nextafter(static_cast<float>(value), kInfinity); }

Vec3 closest_on_segment(Vec3 p, Vec3 a, Vec3 b) {
  const double l2 = squared_length(b - a);
  return l2 > 0 ? a + std::clamp(dot(p - a, b - a) / l2, 0.0, 1.0) * (b - a) : a;
}

Vec3 closest_on_outline(Vec3 p, const Triangle& t) {
  Vec3 best = closest_on_segment(p, t.a, t.b);
  for (const Vec3 candidate : {closest_on_segment(p, t.b, t.c), closest_on_segment(p, t.c, t.a)}) {
    if (squared_length(candidate - p) < squared_length(best - p)) best = candidate;
  }
  return best;
}

struct Query {
  const std::vector<Triangle>* triangles;
  Vec3 point;
  Foot foot;
};

// Embree's boxes and query are floats, so the radius it may skip beyond is kept a little larger than the best distance.
bool visit(RTCPointQueryFunctionArguments* arguments) {
  Query& query = *static_cast<Query*>(arguments->userPtr);
  const Vec3 place = closest_on_triangle(query.point, (*query.triangles)[arguments->primID]);
  const double squared_distance = squared_length(place - query.point);
  if (!(squared_distance < query.foot.squared_distance)) return false;
  query.foot = {place, squared_distance, arguments->primID};
  const double size = length(query.point) + 1;
  const float radius = above(std::sqrt(squared_distance) * (1 + 1e-6) + 1e-6 * size);
  if (!(radius < arguments->query->radius)) return false;
  arguments->query->radius = radius;
  return true;
}

}  // namespace

// Inside the prism over the triangle the foot lies on its plane, elsewhere on its outline.
Vec3 closest_on_triangle(Vec3 p, const Triangle& t) {
  const Vec3 normal = cross(t.b - t.a, t.c - t.a);
  const double n2 = squared_length(normal);
  const bool inside = n2 > 0 && dot(cross(t.b - t.a, p - t.a), normal) >= 0 &&
                      dot(cross(t.c - t.b, p - t.b), normal) >= 0 && dot(cross(t.a - t.c, p - t.c), normal) >= 0;
  return inside ? p - (dot(p - t.a, normal) / n2) * normal : closest_on_outline(p, t);
}

struct Surface::Scene {
  std::vector<Triangle> triangles;
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;

  explicit Scene(std::vector<Triangle> its_triangles) : triangles(std::move(its_triangles)) {
    device = rtcNewDevice(nullptr);
    if (device == nullptr) throw Error(ErrorKind::failed, "Embree cannot be used on this processor");
    scene = rtcNewScene(device);
    const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_USER);
    rtcSetGeometryUserPrimitiveCount(geometry, static_cast<unsigned>(triangles.size()));
    rtcSetGeometryUserData(geometry, this);
    rtcSetGeometryBoundsFunction(geometry, bounds, nullptr);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcReleaseGeometry(geometry);
    rtcCommitScene(scene);
    const RTCError error = rtcGetDeviceError(device);
    if (error == RTC_ERROR_OUT_OF_MEMORY) throw Error(ErrorKind::memory, "no memory for the tree of the mesh");
    if (error != RTC_ERROR_NONE) throw Error(ErrorKind::failed, "Embree cannot build the tree of the mesh");
  }
  ~Scene() {
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  static void bounds(const RTCBoundsFunctionArguments* arguments) {
    const Triangle& t = static_cast<const Scene*>(arguments->geometryUserPtr)->triangles[arguments->primID];
    RTCBounds& box = *arguments->bounds_o;
    box.lower_x = below(std::min({t.a.x, t.b.x, t.c.x}));
    box.lower_y = below(std::min({t.a.y, t.b.y, t.c.y}));
    box.lower_z = below(std::min({t.a.z, t.b.z, t.c.z}));
    box.upper_x = above(std::max({t.a.x, t.b.x, t.c.x}));
    box.upper_y = above(std::max({t.a.y, t.b.y, t.c.y}));
    box.upper_z = above(std::max({t.a.z, t.b.z, t.c.z}));
  }
};

Surface::Surface(std::vector<Triangle> triangles) : scene_(std::make_unique<Scene>(std::move(triangles))) {}
Surface::~Surface() = default;
Surface::Surface(Surface&&) noexcept = default;

// A point from so far away that its square would overflow a float asks from nearer, in the same direction: for a
// surface of size 1 that changes the distance by less than 1e-8 of itself.
Foot Surface::closest(Vec3 point) const {
  constexpr double kFar = 1e4;
  const double away = length(point);
  const Vec3 from = away > kFar ? (kFar / away) * point : point;
  Query query = {&scene_->triangles, from, {}};
  RTCPointQuery embree_query = {static_cast<float>(from.x), static_cast<float>(from.y), static_cast<float>(from.z), 0,
                                kInfinity};
  RTCPointQueryContext context;
  rtcInitPointQueryContext(&context);
  rtcPointQuery(scene_->scene, &embree_query, &context, visit, &query);
  if (away <= kFar || !std::isfinite(query.foot.squared_distance)) return query.foot;
  const Vec3 place = closest_on_triangle(point, scene_->triangles[query.foot.triangle]);
  return {place, squared_length(place - point), query.foot.triangle};
}

}  // namespace pointfair::cli
