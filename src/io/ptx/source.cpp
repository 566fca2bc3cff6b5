// SPDX-License-Identifier: Apache-2.0
#include "io/ptx/source.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "io/colors.hpp"
#include "io/formats.hpp"
#include "io/narrowest.hpp"
#include "io/parallel.hpp"
#include "io/plain_row.hpp"
#include "io/text_source.hpp"

namespace pointfair::io {
namespace ptx {
namespace {

constexpr const char* kScanColumn = "scan";
constexpr double kMissing = std::numeric_limits<double>::quiet_NaN();

// A scanner writes zeros where nothing came back.
bool is_invalid(const Position& own) { return own[0] == 0 && own[1] == 0 && own[2] == 0; }

// The word at `index` of a row; empty where the row is too short.
std::string_view word_at(std::string_view row, std::size_t index) {
  std::string_view word;
  for (std::size_t i = 0; i <= index; ++i)
    if (!next_word(row, word)) return {};
  return word;
}

// Intensities are numbers from 0 to 1, whatever digits they happen to have.
NativeType type_of(const std::string& name, const Narrowest& seen) {
  if (name == "intensity" && seen.fits_float) return NativeType::float32;
  return seen.type();
}

}  // namespace

PtxSource::PtxSource(FileBytes bytes, std::string name, Layout layout)
    : Source(std::move(bytes), std::move(name), Format::ptx, Encoding::ascii), layout_(std::move(layout)) {
  for (const Scan& scan : layout_.scans) {
    for (const std::string& value : scan.value_names) {
      const auto known = [&](const Column& column) { return column.name == value; };
      if (std::none_of(columns_.begin(), columns_.end(), known))
        columns_.push_back({value, NativeType::float32, 1, true});
    }
  }
  release_all();  // which was read for its rows
}

// Calls visit(row, point), the point counted from the first of the block.
template <class Visit>
void PtxSource::for_each_row(std::size_t block, const Visit& visit) const {
  const Block& where = layout_.blocks[block];
  std::string_view rest = bytes().substr(where.begin, where.end - where.begin), line;
  std::size_t point = 0;
  while (next_line(rest, line))
    if (is_row(line, RowRule::filled)) visit(line, point++);
}

Position PtxSource::own_position(std::string_view row) const {
  Position own;
  if (PlainRow(row, ' ').position(own)) return own;
  std::string_view rest = row, word;
  for (double& value : own) {
    if (!next_word(rest, word)) fail_at(row.data(), "too few values: " + quoted(row) + "; repair the line");
    const std::optional<double> number = to_number(word);
    if (!number) fail_at(row.data(), quoted(word) + " is not a number; repair the line");
    value = *number;
  }
  return own;
}

void PtxSource::positions(std::size_t block, std::span<Position> out) const {
  const Pose& pose = scan_of(block).pose;
  for_each_row(block, [&](std::string_view row, std::size_t point) {
    const Position own = own_position(row);
    if (is_invalid(own)) {
      out[point].fill(std::numeric_limits<double>::quiet_NaN());
    } else {
      out[point] = pose.is_identity ? own : pose.to_shared(own);
    }
  });
  const Block& where = layout_.blocks[block];
  release(bytes().substr(where.begin, where.end - where.begin));
}

ScalarType PtxSource::coordinate_type() const {
  if (origin() != Position{}) return ScalarType::float64;
  for (const Scan& scan : layout_.scans)
    if (!scan.pose.is_identity) return ScalarType::float64;
  std::vector<Narrowest> seen(block_count());
  for_each_block(seen.size(), [&](std::size_t block) {
    for_each_row(block, [&](std::string_view row, std::size_t) {
      std::string_view word;
      for (int axis = 0; axis < 3 && next_word(row, word); ++axis) seen[block].see(word);
    });
  });
  const bool all = std::all_of(seen.begin(), seen.end(), [](const Narrowest& n) { return n.fits_float; });
  return all ? ScalarType::float32 : ScalarType::float64;
}

void PtxSource::find_types() const {
  std::vector<std::vector<Narrowest>> seen(block_count(), std::vector<Narrowest>(columns_.size()));
  const std::size_t own = columns_.size();
  for_each_block(seen.size(), [&](std::size_t block) {
    const std::vector<std::string>& names = scan_of(block).value_names;
    std::vector<std::size_t> owner(names.size());
    for (std::size_t v = 0; v < names.size(); ++v)
      owner[v] = static_cast<std::size_t>(
          std::find_if(columns_.begin(), columns_.end(), [&](const Column& c) { return c.name == names[v]; }) -
          columns_.begin());
    for_each_row(block, [&](std::string_view row, std::size_t) {
      PlainRow plain(row, ' ');
      bool is_plain = plain.skip(3);
      for (std::size_t v = 0; v < owner.size(); ++v) {
        std::string_view word;
        unsigned count = 0;
        if (is_plain && plain.short_count(count)) {
          seen[block][owner[v]].see_count(count);
          continue;
        }
        is_plain = is_plain && plain.word(word);
        if (!is_plain) word = word_at(row, 3 + v);
        seen[block][owner[v]].see(word);
      }
    });
  });
  std::vector<Narrowest> all(own);
  for (const std::vector<Narrowest>& block : seen)
    for (std::size_t c = 0; c < own; ++c) all[c].merge(block[c]);
  for (std::size_t c = 0; c < own; ++c) {
    const auto lacks = [&](const Scan& scan) {
      return scan.count() > 0 &&
             std::find(scan.value_names.begin(), scan.value_names.end(), columns_[c].name) == scan.value_names.end();
    };
    if (std::any_of(layout_.scans.begin(), layout_.scans.end(), lacks)) all[c].see({});  // no number is there: not 0
    columns_[c].type = type_of(columns_[c].name, all[c]);
  }
  if (layout_.scans.size() > 1) columns_.push_back({kScanColumn, NativeType::uint32, 1});
}

std::vector<Column> PtxSource::columns() const {
  std::call_once(types_found_, [this] { find_types(); });
  return columns_;
}

std::optional<double> PtxSource::number_at(std::string_view row, std::size_t index, const Column& column) const {
  const std::string_view word = word_at(row, index);
  const std::optional<double> value = to_number(word);
  if (!value && !word.empty())
    fail_at(row.data(), quoted(word) + " in column " + column.name + " is not a number; repair the line");
  return value;
}

void PtxSource::extract_block(std::size_t index, std::size_t block, std::span<char> out) const {
  std::vector<std::span<char>> places(columns_.size());
  places[index] = out;
  extract_several_of_block(block, places);
}

// What a scan does not have is not a number, or 0.
void PtxSource::fill_absent(const Column& column, std::size_t block, std::span<char> out) const {
  const double absent = column.name == kScanColumn ? static_cast<double>(layout_.blocks[block].scan) : kMissing;
  for (std::size_t at = 0; at < out.size(); at += size_of(column.type))
    store_double(out.data() + at, column.type, false, absent);
}

// In one walk along each row.
void PtxSource::extract_several_of_block(std::size_t block, std::span<const std::span<char>> out) const {
  const std::vector<std::string>& names = scan_of(block).value_names;
  struct Wanted {
    std::size_t word;  // behind the coordinates
    Column column;
    char* to;
  };
  std::vector<Wanted> wanted;
  for (std::size_t c = 0; c < out.size(); ++c) {
    if (out[c].empty()) continue;
    const auto word = static_cast<std::size_t>(std::find(names.begin(), names.end(), columns_[c].name) - names.begin());
    if (word == names.size()) {
      fill_absent(columns_[c], block, out[c]);
    } else {
      wanted.push_back({word, columns_[c], out[c].data()});
    }
  }
  std::sort(wanted.begin(), wanted.end(), [](const Wanted& a, const Wanted& b) { return a.word < b.word; });
  for_each_row(block, [&](std::string_view row, std::size_t) {
    PlainRow plain(row, ' ');
    bool is_plain = plain.skip(3);
    std::size_t word = 0;
    for (Wanted& its : wanted) {
      is_plain = is_plain && plain.skip(its.word - word);
      word = its.word + 1;
      unsigned count = 0;
      double number = 0;
      if (its.column.type == NativeType::uint8 && is_plain && plain.short_count(count)) {
        *its.to = static_cast<char>(count);  // the type holds it
      } else {
        is_plain = is_plain && plain.number(number);
        if (!is_plain) number = number_at(row, 3 + its.word, its.column).value_or(kMissing);
        if (its.column.type == NativeType::float32) {
          const auto value = static_cast<float>(number);
          std::memcpy(its.to, &value, sizeof value);
        } else {
          store_double(its.to, its.column.type, false, number);
        }
      }
      its.to += size_of(its.column.type);
    }
  });
}

std::optional<Position> PtxSource::sensor(std::size_t block) const {
  const Scan& scan = scan_of(block);
  if (!scan.has_place()) return std::nullopt;
  return scan.scanner != Position{} ? scan.scanner : scan.pose.translation;
}

FileInfo PtxSource::info() const {
  FileInfo result;
  const std::vector<Scan>& scans = layout_.scans;
  result.rows.push_back({"scans", std::to_string(scans.size())});
  result.rows.push_back({"poses", std::to_string(std::count_if(scans.begin(), scans.end(),
                                                               [](const Scan& scan) { return scan.has_place(); }))});
  return result;
}

std::vector<Content> PtxSource::contents() const {
  std::vector<Content> result;
  const bool has_place =
      std::any_of(layout_.scans.begin(), layout_.scans.end(), [](const Scan& scan) { return scan.has_place(); });
  if (has_place) result.push_back({ContentKind::poses, "the poses of scans"});
  const bool has_grid = std::any_of(layout_.scans.begin(), layout_.scans.end(),
                                    [](const Scan& scan) { return scan.columns > 1 && scan.rows > 1; });
  if (has_grid) result.push_back({ContentKind::grid, "the columns and rows of scans"});
  return result;
}

// The edits of one block, a row at a time.
struct PtxSource::RowEditor {
  const PtxSource& source;
  const Scan& scan;
  const Moves moves;
  const Edits& edits;
  const std::uint64_t first;
  PatchedText patched;

  // Where the moved point is in the scan's own coordinates. What a double cannot hold of the pose stays out of it.
  Position own_now(const Position& own, std::size_t point) const {
    const Position& now = moves.values[point];
    if (!std::isfinite(now[0] + now[1] + now[2])) return {};
    if (is_invalid(own)) return scan.pose.to_own(now);
    const Position before = scan.pose.to_shared(own);
    const Position shift =
        Pose::turned(scan.pose.inverse, {now[0] - before[0], now[1] - before[1], now[2] - before[2]});
    return {own[0] + shift[0], own[1] + shift[1], own[2] + shift[2]};
  }

  std::string coordinate(std::string_view word, double value, std::size_t axis, const Position& now) const {
    std::string text;
    if (value == 0 || edits.placed) {
      append_number(text, value);
      return text;
    }
    const auto offset = [&](std::size_t a) { return static_cast<float>(std::abs(now[a] - source.origin()[a])); };
    const float coarsest = std::max({offset(0), offset(1), offset(2)});  // a turned coordinate is made of all three
    append_moved(text, word, value, scan.pose.is_identity ? offset(axis) : coarsest);
    return text;
  }

  void move(std::string_view row, std::size_t point) {
    const Position own = source.own_position(row), now = own_now(own, point);
    std::string_view word;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      next_word(row, word);
      const bool changed = scan.pose.is_identity ? (moves.changed[point] >> axis & 1) != 0 : now[axis] != own[axis];
      if (changed) patched.replace(word, coordinate(word, now[axis], axis, moves.values[point]));
    }
  }

  void give_values(std::string_view row, std::size_t point) {
    std::string_view word;
    for (int axis = 0; axis < 3; ++axis) next_word(row, word);
    for (const std::string& name : scan.value_names) {
      if (!next_word(row, word)) return;
      const auto other = std::find_if(edits.replaced.begin(), edits.replaced.end(),
                                      [&](const Replacement& r) { return source.columns_[r.column].name == name; });
      if (other == edits.replaced.end()) continue;
      const double value = other->value(first + point, 0);
      const std::optional<double> own = to_number(word);
      const bool is_float = other->values->type == ScalarType::float32;
      if (own && (*own == value || (is_float && static_cast<float>(*own) == static_cast<float>(value)))) continue;
      std::string text;
      append_as(text, value, native(other->values->type));
      patched.replace(word, text);
    }
  }
};

void PtxSource::append_edited(std::size_t block, const Edits& edits, std::string& to) const {
  const Block& where = layout_.blocks[block];
  const std::string_view text = bytes().substr(where.begin, where.end - where.begin);
  to.reserve(text.size() + text.size() / 4);
  RowEditor editor{*this, scan_of(block), moves(block, edits), edits, where.first_point, {text, to}};
  for_each_row(block, [&](std::string_view row, std::size_t point) {
    if (editor.moves.changed[point] != 0) editor.move(row, point);
    if (!edits.replaced.empty()) editor.give_values(row, point);
  });
  editor.patched.finish();
}

// What stands between blocks, the headers of scans, is copied.
void PtxSource::write(const Edits& edits, Encoding, Output& out) const {
  if (!edits.replaced.empty()) columns();
  write_blocks(out, block_count(), [&](std::size_t block, std::string& buffer) {
    const std::size_t before = block == 0 ? 0 : layout_.blocks[block - 1].end;
    buffer += bytes().substr(before, layout_.blocks[block].begin - before);
    append_edited(block, edits, buffer);
  });
  out.write(bytes().substr(layout_.blocks.back().end));
}

}  // namespace ptx

std::shared_ptr<Source> read_ptx(FileBytes bytes, const std::string& name, const Reading&) {
  ptx::Layout layout = ptx::find_scans(bytes.view(), name);
  return std::make_shared<ptx::PtxSource>(std::move(bytes), name, std::move(layout));
}

// One scan of one row in the coordinates of the cloud.
void write_ptx(Table table, const Writing&, Output& out) {
  use_ply_names(table);
  const std::vector<std::array<std::uint8_t, 3>> colors = colors_as_bytes(table).values;
  const bool colored = !colors.empty();
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
    if (colored)
      for (const std::uint8_t channel : colors[i]) buffer += std::to_string(channel) + ' ';
    buffer.back() = '\n';
  });
}

}  // namespace pointfair::io
