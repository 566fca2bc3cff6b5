// SPDX-License-Identifier: Apache-2.0
// An image of points: where a camera or a lidar measured nothing, some write NaN and others (0, 0, 0).
#pragma once

#include <cmath>
#include <limits>
#include <span>
#include <utility>
#include <vector>

#include "io/parallel.hpp"
#include "io/source.hpp"

namespace pointfair::io {

/// Reads both as NaN where the file is such an image.
template <class Base>
class PixelSource : public Base {
 public:
  template <class... Arguments>
  explicit PixelSource(bool is_image, Arguments&&... arguments)
      : Base(std::forward<Arguments>(arguments)...), is_image_(is_image) {}

  void positions(std::size_t block, std::span<Position> out) const override {
    Base::positions(block, out);
    for (Position& position : out)
      if (is_image_ && position == Position{}) position.fill(std::numeric_limits<double>::quiet_NaN());
  }
  bool copy_points(std::size_t block, std::span<Point> out) const override {
    if (!Base::copy_points(block, out)) return false;
    constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
    for (Point& point : out)
      if (is_image_ && point.x == 0 && point.y == 0 && point.z == 0) point = {kNan, kNan, kNan};
    return true;
  }
  void restore_empty_pixels(std::span<Position> all) const override {
    if (!is_image_) return;
    for_each_block(this->block_count(), [&](std::size_t block) {
      std::vector<Position> own(this->block_size(block));
      Base::positions(block, own);
      const auto now = all.subspan(static_cast<std::size_t>(this->block_begin(block)), own.size());
      for (std::size_t i = 0; i < own.size(); ++i)
        if (own[i] == Position{} && std::isnan(now[i][0])) now[i] = own[i];
    });
  }

 private:
  bool is_image_;
};

}  // namespace pointfair::io
