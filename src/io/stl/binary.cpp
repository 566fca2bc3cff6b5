// SPDX-License-Identifier: Apache-2.0
// Reading STL, and binary files of it: 80 bytes of anything, a count, and 50 bytes for each facet.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "io/formats.hpp"
#include "io/stl/facets.hpp"

namespace pointfair::io {
namespace stl {
namespace {

constexpr std::size_t kTitle = 80, kHeader = 84, kFacet = 50, kCorners = 12,
                      kWord = 48;       // offsets in a file and in a facet
constexpr std::uint64_t kBlock = 2048;  // facets

class BinarySource final : public Source {
 public:
  BinarySource(FileBytes file, std::string file_name, std::uint64_t facets)
      : Source(std::move(file), std::move(file_name), Format::stl, Encoding::binary), facets_(facets) {}

  std::size_t block_count() const override { return static_cast<std::size_t>((facets_ + kBlock - 1) / kBlock); }
  std::uint64_t block_begin(std::size_t block) const override { return 3 * std::min(block * kBlock, facets_); }
  void positions(std::size_t block, std::span<Position> out) const override {
    for (std::size_t i = 0; i < out.size(); ++i) {
      const char* const from = corner(block_begin(block) + i);
      for (std::size_t axis = 0; axis < 3; ++axis) out[i][axis] = double{load_little<float>(from + 4 * axis)};
    }
  }
  bool copy_points(std::size_t block, std::span<Point> out) const override {
    if (kBigEndian) return false;
    for (std::size_t i = 0; i < out.size(); ++i) std::memcpy(&out[i], corner(block_begin(block) + i), sizeof(Point));
    return true;
  }
  ScalarType coordinate_type() const override { return ScalarType::float32; }
  std::vector<Column> columns() const override { return {}; }
  void extract_block(std::size_t, std::size_t, std::span<char>) const override {}
  void visit_faces(FaceVisitor& visitor) const override { visit_facets(facets_, visitor); }
  std::vector<Content> contents() const override {
    std::vector<Content> result;
    if (has_words())
      result.push_back(
          {ContentKind::face_values, "the attribute words of facets, in which some programs keep colours"});
    const std::string_view title = bytes().substr(0, kTitle);
    const bool is_blank = title.find_first_not_of(std::string_view(" \0", 2)) == std::string_view::npos;
    if (!is_blank && !title.starts_with(kOwnTitle)) result.push_back({ContentKind::comments, "the title"});
    return result;
  }

 protected:
  std::string header(const Edits&) const override { return std::string(bytes().substr(0, kHeader)); }
  std::string_view tail() const override {
    return bytes().substr(kHeader + static_cast<std::size_t>(facets_) * kFacet);
  }
  void append_block(std::size_t block, const Moves& moves, const Edits&, std::string& to) const override {
    const std::size_t first = block * kBlock, count = moves.values.size() / 3, base = to.size();
    to += bytes().substr(kHeader + first * kFacet, count * kFacet);
    for (std::size_t f = 0; f < count; ++f)
      if (has_moved(moves, 3 * f)) patch(moves, 3 * f, to.data() + base + f * kFacet);
  }

 private:
  const char* corner(std::uint64_t point) const {
    return bytes().data() + kHeader + static_cast<std::size_t>(point / 3) * kFacet + kCorners +
           static_cast<std::size_t>(point % 3) * sizeof(Point);
  }
  bool has_words() const {
    const char* at = bytes().data() + kHeader + kWord;
    for (std::uint64_t f = 0; f < facets_; ++f, at += kFacet)
      if (at[0] != 0 || at[1] != 0) return true;
    return false;
  }
  // Where a corner moved, and the normal, unless the file leaves it open.
  static void patch(const Moves& moves, std::size_t first, char* facet) {
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t axis = 0; axis < 3; ++axis)
        if (moves.changed[first + c] >> axis & 1)
          store_double(facet + kCorners + c * sizeof(Point) + 4 * axis, NativeType::float32, kBigEndian,
                       moves.values[first + c][axis]);
    const auto is_zero = [](char byte) { return byte == 0; };
    if (std::all_of(facet, facet + kCorners, is_zero)) return;
    const std::array<float, 3> normal = normal_of(moves.values, first);
    for (std::size_t axis = 0; axis < 3; ++axis)
      store_double(facet + 4 * axis, NativeType::float32, kBigEndian, double{normal[axis]});
  }

  std::uint64_t facets_;
};

std::uint64_t facet_count(std::string_view bytes) { return load_little<std::uint32_t>(bytes.data() + kHeader - 4); }

}  // namespace

void visit_facets(std::uint64_t facets, FaceVisitor& visitor) {
  visitor.expect({facets, 3 * facets, true});
  for (std::uint64_t f = 0; f < facets; ++f) {
    const auto first = static_cast<std::uint32_t>(3 * f);
    const std::uint32_t corners[] = {first, first + 1, first + 2};
    visitor.take(corners, {});
  }
}

std::array<float, 3> normal_of(std::span<const Position> corners, std::size_t first) {
  const Position &a = corners[first], &b = corners[first + 1], &c = corners[first + 2];
  const Position u{b[0] - a[0], b[1] - a[1], b[2] - a[2]}, v{c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  const Position cross{u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
  const double length = std::sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]);
  if (!(length > 0) || !std::isfinite(length)) return {};
  return {static_cast<float>(cross[0] / length), static_cast<float>(cross[1] / length),
          static_cast<float>(cross[2] / length)};
}

bool is_binary(std::string_view bytes) {
  return bytes.size() >= kHeader && bytes.size() == kHeader + facet_count(bytes) * kFacet;
}

std::shared_ptr<Source> read_binary(FileBytes bytes, const std::string& name) {
  const std::size_t size = bytes.view().size();
  if (size < kHeader) fail(name, "ends within the header of an STL file; copy the file again");
  const std::uint64_t facets = facet_count(bytes.view()), held = (size - kHeader) / kFacet;
  if (facets > held)
    fail(name, "header promises " + std::to_string(facets) + " facets, file ends after " + std::to_string(held) +
                   "; copy the file again");
  if (facets == 0) fail(name, "has no facets; choose another file");
  if (facets > 0xFFFFFFFF / 3) fail(name, "has more corners than can be counted; cut the mesh");
  return std::make_shared<BinarySource>(std::move(bytes), name, facets);
}

}  // namespace stl

std::shared_ptr<Source> read_stl(FileBytes bytes, const std::string& name, const Reading&) {
  // Binary files may begin with "solid", too; their size tells.
  const bool is_text = bytes.view().starts_with("solid") || bytes.view().starts_with("SOLID");
  if (is_text && !stl::is_binary(bytes.view())) return stl::read_text(std::move(bytes), name);
  return stl::read_binary(std::move(bytes), name);
}

}  // namespace pointfair::io
