// SPDX-License-Identifier: Apache-2.0
// The stages of a backend one after the other, all that comes of them, and where two clouds differ.
#pragma once

#include <cstdio>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "backend.hpp"

namespace pointfair {

struct StageSettings {
  NeighborSettings neighbors{8, 0, false, 0};
  NormalSettings normals{true, 0.1f};
  FairingSettings fairing{Method::bilateral, AreaWeight::none, 0.1f, 0.05f};
  int passes = 1;
  DisplacementLimits limits;
  std::optional<CurveCube> cube;
  bool leaving = false;  // the download is announced
};

struct StageResults {
  std::vector<Point> points, normals;
  Counts counts;
  std::uint64_t held_back = 0;
};

// `while_arriving`: stages are started before the upload has ended.
inline StageResults run(Backend& backend, const std::vector<Point>& points, const StageSettings& settings,
                        bool while_arriving = false) {
  if (settings.cube) backend.order_along(settings.cube);
  if (while_arriving) {
    backend.start_upload(points);
  } else {
    backend.upload(points);
  }
  for (int pass = 0; pass < settings.passes; ++pass) {
    backend.begin_pass(pass);
    backend.build_index({});
    backend.find_neighbors(settings.neighbors, {});
    backend.estimate_normals(settings.normals, {});
    if (settings.leaving) backend.expect_download();
    backend.fair(settings.fairing, {});
  }
  StageResults result{std::vector<Point>(points.size()), std::vector<Point>(points.size()), {}, 0};
  result.held_back = backend.download(result.points, settings.limits, {});
  backend.finish_upload();
  backend.download_normals(result.normals);
  result.counts = backend.counts();
  return result;
}

// Places where two clouds differ in a bit, the first of them in words.
inline std::string difference(const std::vector<Point>& a, const std::vector<Point>& b) {
  std::size_t count = 0, first = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    if (std::memcmp(&a[i], &b[i], sizeof(Point)) != 0 && count++ == 0) first = i;
  if (count == 0) return "";
  const Point p = a[first], q = b[first];
  char text[200];
  std::snprintf(text, sizeof text, "%zu of %zu differ, first %zu: %.9g %.9g %.9g and %.9g %.9g %.9g", count, a.size(),
                first, double(p.x), double(p.y), double(p.z), double(q.x), double(q.y), double(q.z));
  return text;
}

}  // namespace pointfair
