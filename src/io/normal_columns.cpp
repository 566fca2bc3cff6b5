// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "io/box_of.hpp"
#include "io/column_names.hpp"
#include "io/source.hpp"
#include "io/text.hpp"
#include "pointfair/normals.hpp"

namespace pointfair {
namespace {

constexpr std::array<const char*, 3> kAxes = {"nx", "ny", "nz"};

// Whether the attribute can hold them.
bool is_float(const AttributeInfo& info, const std::vector<io::Column>& columns) {
  if (info.type == ScalarType::float32 || info.type == ScalarType::float64) return true;
  return std::ranges::any_of(columns, [&](const auto& c) { return c.name == info.name && c.guessed; });
}

// Which component of a normal the attribute is, under one of the names that formats and programs use.
std::optional<std::size_t> axis_of(const std::string& name) {
  std::string plain = io::ply_name(name);
  const std::string lower = io::lower_case(name);
  if (lower.starts_with("normal") && lower.size() <= 8) plain = std::string("n") + lower.back();  // NormalX, normal_x
  const auto axis = std::ranges::find(kAxes, plain);
  if (axis == kAxes.end()) return std::nullopt;
  return static_cast<std::size_t>(axis - kAxes.begin());
}

void put(Attribute& attribute, std::size_t place, float value) {
  auto* const to = reinterpret_cast<char*>(attribute.data.data());
  io::store_double(to + place * size_of(attribute.type), io::native(attribute.type), false, value);
}

Attribute zeros(const std::string& name, std::uint32_t components, std::size_t floats) {
  Attribute result{{name, ScalarType::float32, components}, {}};
  result.data.resize(floats * sizeof(float));
  return result;
}

// An attribute whose values are floats, whatever they were.
Attribute as_floats(Attribute from) {
  if (from.type == ScalarType::float32 || from.type == ScalarType::float64) return from;
  Attribute floats = zeros(from.name, from.components, from.data.size() / size_of(from.type));
  from.components = 1;  // one value after the other
  for (std::size_t i = 0; i < floats.data.size() / sizeof(float); ++i)
    put(floats, i, static_cast<float>(value_at(from, i)));
  return floats;
}

// The normals of a cloud as they are held: in one attribute or in three.
class Holder {
 public:
  Holder(const Cloud& cloud, const std::vector<std::string>& names) {
    for (Attribute& values : attribute_values(cloud, names)) attributes_.push_back(as_floats(std::move(values)));
    if (names.empty()) attributes_.push_back(zeros("normal", 3, 3 * cloud.points.size()));
  }

  std::array<double, 3> at(std::size_t point) const {
    std::array<double, 3> normal{};
    for (std::uint32_t axis = 0; axis < 3; ++axis)
      normal[axis] =
          attributes_.size() == 1 ? value_at(attributes_[0], point, axis) : value_at(attributes_[axis], point);
    return normal;
  }
  void set(std::size_t point, const std::array<float, 3>& normal) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      attributes_.size() == 1 ? put(attributes_[0], 3 * point + axis, normal[axis])
                              : put(attributes_[axis], point, normal[axis]);
  }
  // In the place of what was added under the same name.
  void give_to(Cloud& cloud) {
    for (Attribute& mine : attributes_) {
      std::erase_if(cloud.added, [&](const Attribute& other) { return other.name == mine.name; });
      cloud.added.push_back(std::move(mine));
    }
  }

 private:
  std::vector<Attribute> attributes_;
};

// Where normals look from a point, if neither the file's own normals nor a sensor says so.
class Outward {
 public:
  explicit Outward(const Cloud& cloud) {
    io::BoxOf<float> box;
    for (const Point& p : cloud.points)
      if (std::isfinite(p.x + p.y + p.z)) box.add({p.x, p.y, p.z});
    const auto& [low, high] = box;
    constexpr float kFlat = 0.25F;
    flat_ = high[2] - low[2] < kFlat * std::max(high[0] - low[0], high[1] - low[1]);
    for (std::size_t axis = 0; axis < 3; ++axis) middle_[axis] = low[axis] + (high[axis] - low[axis]) / 2;
  }
  std::array<double, 3> from(const Point& p) const {
    if (flat_) return {0, 0, 1};
    return {double{p.x} - middle_[0], double{p.y} - middle_[1], double{p.z} - middle_[2]};
  }

 private:
  bool flat_ = false;
  std::array<double, 3> middle_{};
};

double dot(const Point& normal, const std::array<double, 3>& direction) {
  return normal.x * direction[0] + normal.y * direction[1] + normal.z * direction[2];
}

}  // namespace

std::vector<std::string> normal_attributes(const Cloud& cloud) {
  std::array<std::string, 3> names;
  const std::vector<io::Column> columns = cloud.source ? cloud.source->columns() : std::vector<io::Column>{};
  for (const AttributeInfo& info : attributes(cloud)) {
    if (!is_float(info, columns)) continue;
    const std::string lower = io::lower_case(info.name);
    if (info.components == 3 && (lower == "normal" || lower == "normals")) return {info.name};
    const auto axis = info.components == 1 ? axis_of(info.name) : std::nullopt;
    if (axis && names[*axis].empty()) names[*axis] = info.name;
  }
  if (std::ranges::any_of(names, &std::string::empty)) return {};
  return {names.begin(), names.end()};
}

void set_normals(Cloud& cloud, std::span<const Point> normals, std::span<const Position> viewpoints,
                 NormalSigns signs) {
  if (viewpoints.size() > 1 && viewpoints.size() != cloud.points.size())
    throw Error(ErrorKind::usage, "the cloud has " + std::to_string(cloud.points.size()) + " points, but there are " +
                                      std::to_string(viewpoints.size()) + " viewpoints; give one, or one for each");
  if (normals.size() != cloud.points.size())
    throw Error(ErrorKind::usage, "the cloud has " + std::to_string(cloud.points.size()) + " points, but there are " +
                                      std::to_string(normals.size()) + " normals; give one for each point");
  io::check_has_points_of_file(cloud);
  const std::vector<std::string> names = normal_attributes(cloud);
  Holder holder(cloud, names);
  const Outward outward(cloud);
  std::size_t block = 0;
  std::optional<Position> sensor;
  for (std::size_t i = 0; i < normals.size(); ++i) {
    for (; cloud.source && block < cloud.source->block_count() && i == cloud.source->block_begin(block); ++block)
      sensor = cloud.source->says_sensor() ? cloud.source->sensor(block) : std::nullopt;
    Point normal = normals[i];
    if (normal.x == 0 && normal.y == 0 && normal.z == 0) continue;
    const Point& p = cloud.points[i];
    if (signs == NormalSigns::as_given) {
      holder.set(i, {normal.x, normal.y, normal.z});
      continue;
    }
    const auto to = [&](const Position& place) {
      return std::array<double, 3>{place[0] - cloud.origin[0] - p.x, place[1] - cloud.origin[1] - p.y,
                                   place[2] - cloud.origin[2] - p.z};
    };
    double side = viewpoints.empty() ? 0 : dot(normal, to(viewpoints[viewpoints.size() > 1 ? i : 0]));
    if (!(std::abs(side) > 0)) side = names.empty() ? 0 : dot(normal, holder.at(i));
    if (!(std::abs(side) > 0)) side = dot(normal, sensor ? to(*sensor) : outward.from(p));
    if (side < 0) normal = {0 - normal.x, 0 - normal.y, 0 - normal.z};  // no -0
    holder.set(i, {normal.x, normal.y, normal.z});
  }
  holder.give_to(cloud);
}

}  // namespace pointfair
