// SPDX-License-Identifier: Apache-2.0
// Some points of a file as a file of their own, to look at its attributes part by part.
#pragma once

#include <algorithm>
#include <cstring>
#include <memory>
#include <ranges>
#include <utility>

#include "io/source.hpp"

namespace pointfair::io {

/// `count` points of `whole` from `first` on, one block. Is read only.
class PointsOfSource final : public Source {
 public:
  PointsOfSource(std::shared_ptr<const Source> whole, std::uint64_t first, std::uint64_t count)
      : Source(FileBytes::copy({}), whole->name(), whole->format(), whole->encoding()),
        whole_(std::move(whole)),
        first_(first),
        count_(count) {}

  std::size_t block_count() const override { return 1; }
  std::uint64_t block_begin(std::size_t block) const override { return block * count_; }
  void positions(std::size_t, std::span<Position> out) const override {
    for_blocks(out, [&](std::size_t block, std::span<Position> all) { whole_->positions(block, all); });
  }
  ScalarType coordinate_type() const override { return whole_->coordinate_type(); }
  std::vector<Column> columns() const override { return whole_->columns(); }
  void extract_block(std::size_t index, std::size_t, std::span<char> out) const override {
    for_blocks(out, [&](std::size_t block, std::span<char> all) { whole_->extract_block(index, block, all); });
  }
  FileInfo info() const override { return of_some_points(whole_->info()); }

 private:
  // Calls get(block, values) for each block that has some of the points, and takes theirs.
  template <class T, class Get>
  void for_blocks(std::span<T> out, const Get& get) const {
    if (count_ == 0) return;
    const std::size_t of_point = out.size() / count_;
    const auto ends_before = [&](std::size_t block) { return whole_->block_begin(block + 1) <= first_; };
    const auto blocks = std::views::iota(std::size_t{0}, whole_->block_count());
    for (std::size_t block = *std::ranges::partition_point(blocks, ends_before);
         whole_->block_begin(block) < first_ + count_; ++block) {
      const std::uint64_t begin = whole_->block_begin(block), end = whole_->block_begin(block + 1);
      const std::uint64_t from = std::max(begin, first_), to = std::min(end, first_ + count_);
      const std::span<T> its = out.subspan((from - first_) * of_point, (to - from) * of_point);
      if (from == begin && to == end) {
        get(block, its);
        continue;
      }
      std::vector<T> all((end - begin) * of_point);
      get(block, std::span(all));
      std::copy_n(all.begin() + std::ptrdiff_t((from - begin) * of_point), its.size(), its.begin());
    }
  }

  std::shared_ptr<const Source> whole_;
  std::uint64_t first_, count_;
};

}  // namespace pointfair::io
