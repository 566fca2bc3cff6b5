// SPDX-License-Identifier: Apache-2.0
// What a camera or a lidar measured: where nothing came back, some write NaN and others (0, 0, 0); and the rays of an
// image meet in its camera.
#pragma once

#include <cmath>
#include <limits>
#include <mutex>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "io/camera_centre.hpp"
#include "io/empty_returns.hpp"
#include "io/parallel.hpp"
#include "io/source.hpp"

namespace pointfair::io {

/// Reads both as NaN: zeros of an image always, others where EmptyReturns says so.
template <class Base>
class SensorSource : public Base {
 public:
  /// `width`: points a row of an image; 0: the points stand in no grid.
  template <class... Arguments>
  explicit SensorSource(std::uint64_t width, Arguments&&... arguments)
      : Base(std::forward<Arguments>(arguments)...), width_(width) {}

  void positions(std::size_t block, std::span<Position> out) const override {
    Base::positions(block, out);
    if (!are_empty()) return;
    for (Position& position : out)
      if (position == Position{}) position.fill(std::numeric_limits<double>::quiet_NaN());
  }
  bool copy_points(std::size_t block, std::span<Point> out) const override {
    if (!Base::copy_points(block, out)) return false;
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
    if (!are_empty()) return true;
    for (Point& point : out)
      if (point.x == 0 && point.y == 0 && point.z == 0) point = {kNan, kNan, kNan};
    return true;
  }
  void restore_empty_pixels(std::span<Position> all) const override {
    if (!are_empty()) return;
    for_each_block(this->block_count(), [&](std::size_t block) {
      std::vector<Position> own(this->block_size(block));
      Base::positions(block, own);
      const auto now = all.subspan(static_cast<std::size_t>(this->block_begin(block)), own.size());
      for (std::size_t i = 0; i < own.size(); ++i)
        if (own[i] == Position{} && std::isnan(now[i][0])) now[i] = own[i];
    });
  }

  std::optional<Position> sensor(std::size_t) const override {
    const std::optional<Position> told = told_sensor();
    return told ? told : camera();
  }
  bool says_sensor() const override { return width_ == 0 || told_sensor().has_value(); }

  FileInfo info() const override {
    FileInfo result = Base::info();
    if (width_ == 0) return result;
    result.grid_width = width_, result.grid_height = this->size() / width_;
    if (!told_sensor() && camera()) result.rows.push_back({"sensor", where_rays_meet(*camera())});
    return result;
  }

 protected:
  /// Where the sensor stood, as the file's header says it.
  virtual std::optional<Position> told_sensor() const { return std::nullopt; }
  /// Whether points that stand in no grid may have been measured by a sensor.
  virtual bool may_be_returns() const { return true; }

 private:
  bool are_empty() const {
    if (width_ > 0 || !may_be_returns()) return width_ > 0;
    std::call_once(are_counted_, [&] {
      EmptyReturns counted(this->size());
      std::vector<Position> own;
      for (std::size_t block = 0; block < this->block_count(); ++block) {
        own.resize(this->block_size(block));
        Base::positions(block, own);
        counted.take(own);
      }
      are_empty_ = std::move(counted).are_empty();
    });
    return are_empty_;
  }

  const std::optional<Position>& camera() const {
    std::call_once(is_fitted_, [&] {
      if (width_ > 0) camera_ = camera_centre(*this, width_);
    });
    return camera_;
  }

  std::uint64_t width_;
  mutable std::once_flag are_counted_, is_fitted_;
  mutable bool are_empty_ = false;
  mutable std::optional<Position> camera_;
};

}  // namespace pointfair::io
