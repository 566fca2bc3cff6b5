// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

#include "pointfair/limits.hpp"

namespace pointfair {
namespace {

constexpr std::size_t kMaxCorners = 256;

[[noreturn]] void refuse(std::string_view name, std::string_view text, std::string_view wanted) {
  constexpr std::size_t kShown = 60;
  const std::string shown = text.size() > kShown ? std::string(text.substr(0, kShown)) + "..." : std::string(text);
  throw Error(ErrorKind::usage, "--" + std::string(name) + " cannot be '" + shown + "': give " + std::string(wanted));
}

// The numbers between the commas; empty if one of them is none.
std::vector<double> numbers_of(std::string_view text) {
  std::vector<double> numbers;
  const char *at = text.data(), *const end = text.data() + text.size();
  while (true) {
    double value = 0;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc() || !std::isfinite(value)) return {};
    numbers.push_back(value);
    if (next == end) return numbers;
    if (*next != ',') return {};
    at = next + 1;
  }
}

template <class Numbers>
void append_numbers(std::string& text, const Numbers& numbers) {
  for (const double value : numbers) {
    char digits[32];
    if (!text.empty() && text.back() != ':') text += ',';
    text.append(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
  }
}

double strength_of(std::string_view text) {
  const std::vector<double> numbers = numbers_of(text);
  if (numbers.size() != 1 || numbers[0] < 0 || numbers[0] > 1) refuse("strength", text, "a number from 0 to 1, as 0.5");
  return numbers[0];
}

Box box_of(std::string_view text) {
  const std::vector<double> n = numbers_of(text);
  const bool sound = n.size() == 6 && n[0] <= n[3] && n[1] <= n[4] && n[2] <= n[5];
  if (!sound) refuse("box", text, "x,y,z of the lower corner, then x,y,z of the upper");
  return {{n[0], n[1], n[2]}, {n[3], n[4], n[5]}};
}

Lasso lasso_of(std::string_view text) {
  const std::size_t colon = std::min(text.find(':'), text.size());
  const std::vector<double> camera = numbers_of(text.substr(0, colon));
  const std::vector<double> corners = colon < text.size() ? numbers_of(text.substr(colon + 1)) : std::vector<double>{};
  const bool sound =
      camera.size() == 12 && corners.size() % 2 == 0 && corners.size() >= 6 && corners.size() <= 2 * kMaxCorners;
  if (!sound)
    refuse("lasso", text, "12 numbers of a matrix, a colon, and 3 to 256 corners x,y: the viewer writes them");
  Lasso lasso;
  std::ranges::copy(camera, lasso.camera.begin());
  for (std::size_t c = 0; c < corners.size(); c += 2) lasso.polygon.push_back({corners[c], corners[c + 1]});
  return lasso;
}

bool is_inside(const Box& box, const std::array<double, 3>& p) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (!(p[axis] >= box.min[axis] && p[axis] <= box.max[axis])) return false;
  return true;
}

// A ray to the right crosses the outline an odd number of times.
bool is_inside(const std::vector<std::array<double, 2>>& polygon, double x, double y) {
  bool inside = false;
  for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
    const auto &a = polygon[i], &b = polygon[j];
    if ((a[1] > y) != (b[1] > y) && x < (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]) + a[0]) inside = !inside;
  }
  return inside;
}

// A lasso with the rectangle about its polygon, which decides for most points.
struct LassoTest {
  explicit LassoTest(const Lasso& its_lasso) : lasso(its_lasso), low(lasso.polygon.at(0)), high(low) {
    for (const auto& corner : lasso.polygon) {
      for (std::size_t axis = 0; axis < 2; ++axis) {
        low[axis] = std::min(low[axis], corner[axis]);
        high[axis] = std::max(high[axis], corner[axis]);
      }
    }
  }
  bool operator()(const std::array<double, 3>& p) const {
    const auto row = [&](std::size_t r) {
      const double* m = &lasso.camera[4 * r];
      return m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3];
    };
    const double w = row(2);
    if (!(w > 0)) return false;
    const double x = row(0) / w, y = row(1) / w;
    return x >= low[0] && x <= high[0] && y >= low[1] && y <= high[1] && is_inside(lasso.polygon, x, y);
  }

  const Lasso& lasso;
  std::array<double, 2> low, high;
};

// Full strength leaves the bits of a result alone, and what stays those that it had: -0.0 its sign.
Point part_way(const Point& from, const Point& to, float share) {
  const auto along = [share](float a, float b) {
    const float there = a + share * (b - a);
    return there == a ? a : there;
  };
  return {along(from.x, to.x), along(from.y, to.y), along(from.z, to.z)};
}

}  // namespace

void set_limit(Limits& limits, std::string_view name, std::string_view text) {
  if (name == "strength") {
    limits.strength = text.empty() ? 1 : strength_of(text);
  } else if (name == "box") {
    limits.box = text.empty() ? std::nullopt : std::optional(box_of(text));
  } else if (name == "lasso") {
    limits.lasso = text.empty() ? std::nullopt : std::optional(lasso_of(text));
  } else if (name == "where") {
    limits.where = parse_selections(name, text);
  } else if (name == "ignore") {
    limits.ignore = parse_selections(name, text);
  } else {
    throw Error(ErrorKind::usage,
                "there is no limit '" + std::string(name) + "': use strength, box, lasso, where or ignore");
  }
}

std::string limit_text(const Limits& limits, std::string_view name) {
  if (name == "where") return selections_text(limits.where);
  if (name == "ignore") return selections_text(limits.ignore);
  std::string text;
  if (name == "strength" && limits.strength != 1) append_numbers(text, std::array{limits.strength});
  if (name == "box" && limits.box) {
    append_numbers(text, limits.box->min);
    append_numbers(text, limits.box->max);
  }
  if (name == "lasso" && limits.lasso) {
    append_numbers(text, limits.lasso->camera);
    text += ':';
    for (const auto& corner : limits.lasso->polygon) append_numbers(text, corner);
  }
  return text;
}

Cloud without_ignored(const Limits& limits, const Cloud& cloud) {
  Cloud seen = cloud;
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  for (const Selection& selection : limits.ignore) {
    const std::vector<std::uint8_t> ignored = selected_points(selection, cloud);
    for (std::size_t i = 0; i < ignored.size(); ++i)
      if (ignored[i]) seen.points[i] = {kNan, kNan, kNan};
  }
  return seen;
}

std::vector<std::uint8_t> movable_points(const Limits& limits, const Cloud& cloud) {
  if (!limits.box && !limits.lasso && limits.where.empty() && limits.ignore.empty() && limits.mask.empty()) return {};
  std::vector<std::uint8_t> movable = limits.mask;
  if (movable.empty()) movable.assign(cloud.points.size(), 1);
  if (movable.size() != cloud.points.size())
    throw Error(ErrorKind::usage, "limits: the mask must have one value for each point");
  const auto keep = [&](const auto& contains) {
    for (std::size_t i = 0; i < movable.size(); ++i) {
      const Point& p = cloud.points[i];
      const std::array<double, 3> position{cloud.origin[0] + p.x, cloud.origin[1] + p.y, cloud.origin[2] + p.z};
      if (movable[i] && !contains(position)) movable[i] = 0;
    }
  };
  if (limits.box) keep([&](const auto& position) { return is_inside(*limits.box, position); });
  if (limits.lasso) keep(LassoTest(*limits.lasso));
  const auto select = [&](const Selection& selection, std::uint8_t moves) {
    const std::vector<std::uint8_t> selected = selected_points(selection, cloud);
    for (std::size_t i = 0; i < movable.size(); ++i) movable[i] = movable[i] && selected[i] == moves;
  };
  for (const Selection& selection : limits.where) select(selection, 1);
  for (const Selection& selection : limits.ignore) select(selection, 0);
  return movable;
}

void apply_limits(const Limits& limits, std::span<const std::uint8_t> movable, std::span<const Point> before,
                  std::span<Point> after) {
  if (before.size() != after.size() || (!movable.empty() && movable.size() != after.size()))
    throw Error(ErrorKind::usage, "limits: the clouds before and after must have as many points");
  for (std::size_t i = 0; i < movable.size(); ++i)
    if (!movable[i]) after[i] = before[i];
  if (limits.strength == 1) return;
  const float share = float(limits.strength);
  for (std::size_t i = 0; i < after.size(); ++i) {
    const Point &p = before[i], q = after[i];
    if (q.x != p.x || q.y != p.y || q.z != p.z) after[i] = part_way(p, q, share);  // a NaN keeps its bits
  }
}

}  // namespace pointfair
