// SPDX-License-Identifier: Apache-2.0
// Reading and writing PTX: the points of all scans, one scan after the other, in the coordinates that they share.
#include <algorithm>
#include <cmath>
#include <limits>

#include "io/colors.hpp"
#include "io/formats.hpp"
#include "io/ptx/scans.hpp"

namespace pointfair::io {
namespace ptx {
namespace {

// A scanner writes zeros where nothing came back.
bool is_invalid(const Position& own) { return own == Position{}; }

// Where a moved point is in the scan's own coordinates. What a double cannot hold of the pose stays out of it.
Position own_now(const Pose& pose, const Position& own, const Position& now) {
  if (!std::isfinite(now[0] + now[1] + now[2])) return {};
  if (pose.is_identity) return now;
  if (is_invalid(own)) return pose.to_own(now);
  const Position before = pose.to_shared(own);
  const Position shift = Pose::turned(pose.inverse, {now[0] - before[0], now[1] - before[1], now[2] - before[2]});
  return {own[0] + shift[0], own[1] + shift[1], own[2] + shift[2]};
}

class PtxSource final : public TextSource {
 public:
  PtxSource(FileBytes bytes, const std::string& name, Layout layout)
      : TextSource(std::move(bytes), name, Format::ptx, std::move(layout.text)),
        scans_(std::move(layout.scans)),
        scan_of_block_(std::move(layout.scan_of_block)) {}

  void positions(std::size_t block, std::span<Position> out) const override {
    TextSource::positions(block, out);
    const Pose& pose = scan_of(block).pose;
    for (Position& position : out) {
      if (is_invalid(position)) {
        position.fill(std::numeric_limits<double>::quiet_NaN());
      } else if (!pose.is_identity) {
        position = pose.to_shared(position);
      }
    }
  }

  std::vector<Column> columns() const override {
    std::vector<Column> columns = TextSource::columns();
    if (scans_.size() > 1) columns.push_back({"scan", NativeType::uint32, 1});
    return columns;
  }

  void extract_block(std::size_t index, std::size_t block, std::span<char> out) const override {
    if (index < attribute_count()) return TextSource::extract_block(index, block, out);
    for (std::size_t at = 0; at < out.size(); at += sizeof(std::uint32_t))
      store_double(out.data() + at, NativeType::uint32, false, static_cast<double>(scan_of_block_[block]));
  }

  std::string why_fixed(std::size_t column) const override {
    if (column < attribute_count()) return {};
    return "PTX files tell the scan of a point by where it stands; choose PLY, or leave 'scan' as it is";
  }

  std::optional<Position> sensor(std::size_t block) const override {
    const Scan& scan = scan_of(block);
    if (!scan.has_place()) return std::nullopt;
    return scan.scanner != Position{} ? scan.scanner : scan.pose.translation;
  }

  FileInfo info() const override {
    FileInfo result;
    result.rows.push_back({"scans", std::to_string(scans_.size())});
    result.rows.push_back({"poses", std::to_string(std::ranges::count_if(scans_, &Scan::has_place))});
    return result;
  }

  std::vector<Content> contents() const override {
    std::vector<Content> result = TextSource::contents();
    const bool has_place = std::ranges::any_of(scans_, &Scan::has_place);
    if (has_place) result.push_back({ContentKind::poses, "the poses of scans"});
    const bool has_grid =
        std::ranges::any_of(scans_, [](const Scan& scan) { return scan.columns > 1 && scan.rows > 1; });
    if (has_grid) result.push_back({ContentKind::grid, "the columns and rows of scans"});
    return result;
  }

 protected:
  // What a scan does not have is behind the end of its rows.
  std::vector<TextColumn> attributes_of(std::size_t block) const override {
    std::vector<TextColumn> attributes = TextSource::attributes_of(block);
    const std::vector<std::string>& names = scan_of(block).value_names;
    std::size_t absent = names.size();
    for (TextColumn& column : attributes) {
      const auto at = static_cast<std::size_t>(std::ranges::find(names, column.name) - names.begin());
      column.first = 3 + (at < names.size() ? at : absent++);
    }
    return attributes;
  }

  // A turned coordinate is made of all three.
  float offset_of(std::size_t block, const Position& position, std::size_t axis) const override {
    const Pose& pose = scan_of(block).pose;
    if (pose.is_identity) return TextSource::offset_of(block, position, axis);
    const Position shared = pose.to_shared(position);
    double coarsest = 0;
    for (std::size_t a = 0; a < 3; ++a) coarsest = std::max(coarsest, std::abs(shared[a] - origin()[a]));
    return static_cast<float>(coarsest);
  }

  void append_block(std::size_t block, const Moves& moves, const Edits& edits, std::string& to) const override {
    Moves own{std::vector<Position>(moves.values.size()), moves.changed};
    TextSource::positions(block, own.values);
    for (std::size_t i = 0; i < own.values.size(); ++i) {
      if (own.changed[i] == 0) continue;
      const Position now = own_now(scan_of(block).pose, own.values[i], moves.values[i]);
      own.changed[i] = 0;
      for (std::size_t axis = 0; axis < 3; ++axis)
        own.changed[i] |= static_cast<std::uint8_t>((now[axis] != own.values[i][axis]) << axis);
      own.values[i] = now;
    }
    TextSource::append_block(block, own, edits, to);
  }

 private:
  const Scan& scan_of(std::size_t block) const { return scans_[scan_of_block_[block]]; }

  std::vector<Scan> scans_;
  std::vector<std::size_t> scan_of_block_;
};

}  // namespace
}  // namespace ptx

std::shared_ptr<Source> read_ptx(FileBytes bytes, const std::string& name, const Reading&) {
  ptx::Layout layout = ptx::find_scans(bytes.view(), name);
  return std::make_shared<ptx::PtxSource>(std::move(bytes), name, std::move(layout));
}

// One scan of one row in the coordinates of the cloud.
void write_ptx(Table table, const Writing&, Output& out) {
  use_ply_names(table);
  const auto colors = table.find_all(kChannels);
  const TableColumn* const intensity = table.find("intensity");
  out.write(std::to_string(table.size()) + "\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
  write_rows(out, table.size(), [&](std::size_t i, std::string& buffer) {
    const Position& p = table.positions[i];
    if (!std::isfinite(p[0] + p[1] + p[2])) {
      buffer += "0 0 0 ";
    } else {
      append_position(buffer, table, i, ' ');
    }
    if (intensity) {
      append_value(buffer, *intensity, i, ' ');
    } else {
      buffer += "0.5 ";  // every row has one; this is what other writers put where none is known
    }
    for (const TableColumn* column : colors) append_value(buffer, *column, i, ' ');
    buffer.back() = '\n';
  });
}

}  // namespace pointfair::io
