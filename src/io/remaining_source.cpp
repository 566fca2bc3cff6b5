// SPDX-License-Identifier: Apache-2.0
#include "io/remaining_source.hpp"

#include <algorithm>
#include <cstring>
#include <optional>
#include <string>
#include <utility>

#include "io/parallel.hpp"
#include "io/placed_source.hpp"
#include "pointfair/io.hpp"

namespace pointfair {
namespace io {

RemainingSource::RemainingSource(std::shared_ptr<const Source> file, std::span<const std::uint8_t> removed)
    : Source(FileBytes::copy({}), file->name(), file->format(), file->encoding()),
      file_(std::move(file)),
      columns_(file_->columns()) {
  block_ends_.reserve(file_->block_count());
  std::uint64_t i = 0;
  for (std::size_t block = 0; block < file_->block_count(); ++block) {
    for (const std::uint64_t end = file_->block_begin(block + 1); i < end; ++i)
      if (removed[static_cast<std::size_t>(i)] == 0) kept_.push_back(static_cast<std::uint32_t>(i));
    block_ends_.push_back(kept_.size());
  }
  place_at(file_->origin());
}

std::uint64_t RemainingSource::block_begin(std::size_t block) const { return block == 0 ? 0 : block_ends_[block - 1]; }

std::span<const std::uint32_t> RemainingSource::kept_of(std::size_t block) const {
  return std::span(kept_).subspan(static_cast<std::size_t>(block_begin(block)), block_size(block));
}

void RemainingSource::positions(std::size_t block, std::span<Position> out) const {
  std::vector<Position> all(file_->block_size(block));
  file_->positions(block, all);
  const std::uint64_t begin = file_->block_begin(block);
  std::ranges::transform(kept_of(block), out.begin(),
                         [&](std::uint32_t i) { return all[static_cast<std::size_t>(i - begin)]; });
}

void RemainingSource::extract_block(std::size_t index, std::size_t block, std::span<char> out) const {
  const std::size_t bytes = column_bytes(columns_[index]);
  std::vector<char> all(file_->block_size(block) * bytes);
  file_->extract_block(index, block, all);
  char* to = out.data();
  for (const std::uint32_t i : kept_of(block)) {
    std::memcpy(to, all.data() + static_cast<std::size_t>(i - file_->block_begin(block)) * bytes, bytes);
    to += bytes;
  }
}

// Values of all points of the file; those that are left out have zeros.
Attribute RemainingSource::of_all(const Attribute& remaining) const {
  Attribute all{remaining, {}};
  const std::size_t bytes = remaining.data.size() / std::max<std::size_t>(1, kept_.size());
  all.data.resize(static_cast<std::size_t>(file_->size()) * bytes);
  for (std::size_t k = 0; k < kept_.size(); ++k)
    std::copy_n(remaining.data.begin() + std::ptrdiff_t(k * bytes), bytes,
                all.data.begin() + std::ptrdiff_t(kept_[k] * bytes));
  return all;
}

// Positions of all points of the file; those that are left out keep the file's.
std::vector<Position> RemainingSource::of_all(const PlacedSource& remaining) const {
  std::vector<Position> all(static_cast<std::size_t>(file_->size()));
  for_each_block(block_count(), [&](std::size_t block) {
    const auto begin = static_cast<std::size_t>(file_->block_begin(block));
    file_->positions(block, std::span(all).subspan(begin, file_->block_size(block)));
    std::vector<Position> its(block_size(block));
    remaining.positions(block, its);
    const std::span<const std::uint32_t> kept = kept_of(block);
    for (std::size_t k = 0; k < kept.size(); ++k) all[kept[k]] = its[k];
  });
  return all;
}

std::vector<std::string> RemainingSource::losses(Encoding to) const {
  if (!file_->leaves_points_out()) return {};
  std::vector<std::string> result = file_->losses(to);
  for (std::string& loss : losses_by_removal(*file_)) result.push_back(std::move(loss));
  return result;
}

std::vector<std::string> losses_by_removal(const Source& file) {
  std::vector<std::string> result;
  for (const Content& content : file.contents())
    if (content.kind == ContentKind::grid) result.push_back(content.what + " has gaps now, so the points are one row");
  return result;
}

std::vector<std::string> RemainingSource::companions() const {
  return file_->leaves_points_out() ? file_->companions() : std::vector<std::string>{};
}

namespace {

// Where the points of a file are, of which a cloud has some.
class MovedRemaining final : public MovedPoints {
 public:
  MovedRemaining(std::span<const std::uint32_t> kept, const std::vector<Point>& now) : kept_(kept), now_(now) {}
  void take(std::uint64_t first, std::span<const Position>, std::span<const Point> before,
            std::span<Point> now) const override {
    std::ranges::copy(before, now.begin());
    const auto from = std::ranges::lower_bound(kept_, first);
    for (auto its = from; its != kept_.end() && *its < first + now.size(); ++its)
      now[static_cast<std::size_t>(*its - first)] = now_[static_cast<std::size_t>(its - kept_.begin())];
  }

 private:
  std::span<const std::uint32_t> kept_;
  const std::vector<Point>& now_;
};

}  // namespace

void RemainingSource::write(const Edits& edits, Encoding encoding, Output& out) const {
  std::vector<std::uint8_t> removed(static_cast<std::size_t>(file_->size()), 1);
  for (const std::uint32_t kept : kept_) removed[kept] = 0;
  Cloud shell{.origin = edits.cloud.origin};
  std::vector<Attribute> values;
  values.reserve(edits.added.size() + edits.replaced.size());
  const MovedRemaining moved(kept_, edits.cloud.points);
  Edits of_file{shell, {}, {}, edits.las_scale, &moved};
  of_file.removed = removed;
  std::optional<PlacedSource> placed;  // the file, with the positions that what is left of it was given
  if (edits.placed) of_file.placed = &placed.emplace(file_, of_all(*edits.placed), edits.placed->coordinate_type());
  if (placed) placed->place_at(edits.placed->origin());
  for (const Attribute* added : edits.added) of_file.added.push_back(&values.emplace_back(of_all(*added)));
  for (const Replacement& its : edits.replaced)
    of_file.replaced.push_back({its.column, &values.emplace_back(of_all(*its.values))});
  file_->write(of_file, encoding, out);
}

namespace {

constexpr std::uint32_t kGone = ~std::uint32_t{0};

// Passes those faces on of which no corner is gone.
class RemainingFaces final : public FaceVisitor {
 public:
  RemainingFaces(const std::vector<std::uint32_t>& now, FaceVisitor& to)
      : FaceVisitor(to.with_texture()), now_(now), to_(to) {}

  void expect(const ExpectedFaces& expected) override { to_.expect({expected.faces, expected.corners, false}); }
  void use(std::uint32_t material) override { to_.use(material); }
  void take(std::span<const std::uint32_t> corners, std::span<const float> texture) override {
    remaining_.clear();
    for (const std::uint32_t corner : corners) {
      if (now_[corner] == kGone) return;
      remaining_.push_back(now_[corner]);
    }
    to_.take(remaining_, texture);
  }

 private:
  const std::vector<std::uint32_t>& now_;
  FaceVisitor& to_;
  std::vector<std::uint32_t> remaining_;
};

}  // namespace

void RemainingSource::visit_faces(FaceVisitor& visitor) const {
  std::vector<std::uint32_t> now(static_cast<std::size_t>(file_->size()), kGone);
  for (std::size_t i = 0; i < kept_.size(); ++i) now[kept_[i]] = static_cast<std::uint32_t>(i);
  RemainingFaces remaining(now, visitor);
  file_->visit_faces(remaining);
}

}  // namespace io

Cloud without_points(const Cloud& cloud, std::span<const std::uint8_t> removed) {
  if (removed.size() != cloud.points.size())
    throw Error(ErrorKind::usage, "without_points: there are " + std::to_string(removed.size()) +
                                      " values, and the cloud has " + std::to_string(cloud.points.size()) + " points");
  io::check_has_points_of_file(cloud);
  Cloud result{.origin = cloud.origin};
  for (std::size_t i = 0; i < removed.size(); ++i)
    if (removed[i] == 0) result.points.push_back(cloud.points[i]);
  if (result.points.empty() && !cloud.points.empty())
    throw Error(ErrorKind::usage, "without_points: no point would be left");
  for (const Attribute& all : cloud.added) {
    Attribute& its = result.added.emplace_back(Attribute{all, {}});
    const std::size_t bytes = all.data.size() / std::max<std::size_t>(1, removed.size());
    for (std::size_t i = 0; i < removed.size(); ++i)
      if (removed[i] == 0)
        its.data.insert(its.data.end(), all.data.begin() + std::ptrdiff_t(i * bytes),
                        all.data.begin() + std::ptrdiff_t((i + 1) * bytes));
  }
  if (cloud.source) result.source = std::make_shared<io::RemainingSource>(cloud.source, removed);
  return result;
}

}  // namespace pointfair
