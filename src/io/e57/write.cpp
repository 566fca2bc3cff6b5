// SPDX-License-Identifier: Apache-2.0
// Writing an E57 file back with moved points: the file as it is, with the bits of coordinates changed where they stand
// and the checksums of their pages renewed.
#include <algorithm>
#include <cmath>
#include <mutex>

#include "io/e57/bounds.hpp"
#include "io/e57/pages.hpp"
#include "io/e57/source.hpp"
#include "io/file_bytes.hpp"
#include "io/parallel.hpp"

namespace pointfair::io::e57 {
namespace {

constexpr std::size_t kWindow = 1024 * kPage;  // bytes of the file that are made at once

// The bits of the value that is nearest to `value` among those that the field can hold.
std::uint64_t bits_of(const Field& field, double value) {
  if (field.kind == Field::Kind::float32) return std::bit_cast<std::uint32_t>(static_cast<float>(value));
  if (field.kind == Field::Kind::float64) return std::bit_cast<std::uint64_t>(value);
  const double integer = std::nearbyint((value - field.offset) / field.scale);
  const auto least = static_cast<double>(field.minimum), most = static_cast<double>(field.maximum);
  const std::int64_t held = integer <= least  ? field.minimum
                            : integer >= most ? field.maximum
                                              : static_cast<std::int64_t>(integer);
  return static_cast<std::uint64_t>(held) - static_cast<std::uint64_t>(field.minimum);
}

Position turned_back(const Pose& pose, const Position& shift) {
  Position result{};
  for (std::size_t axis = 0; axis < 3; ++axis)
    for (std::size_t row = 0; row < 3; ++row) result[axis] += pose.rotation[row][axis] * shift[row];
  return result;
}

// The moved points among some records of a scan: their coordinates in the scan, in both systems if it has both.
struct Moved {
  std::vector<std::uint8_t> changed;
  std::vector<Position> cartesian, spherical;
};

// Where pieces of a stream lie in a window of the file: from `from` on, up to `to`, in logical places.
struct Overlap {
  const Piece* piece;
  std::uint64_t from, to;
};

}  // namespace

class E57Writer {
 public:
  E57Writer(const E57Source& source, const Edits& edits, Output& out)
      : source_(source), file_(source.bytes()), edits_(edits), out_(out) {
    replace_xml();
  }

  void write() {
    const std::size_t length = tail_.empty() ? file_.size() : tail_begin_ + tail_.size();
    write_blocks(out_, (length + kWindow - 1) / kWindow,
                 [&](std::size_t window, std::string& buffer) { append_window(window * kWindow, buffer); });
  }

 private:
  // Where points go beyond the bounds that the XML section names, it is written anew, if nothing follows it.
  void replace_xml() {
    const FileHeader& header = source_.header_;
    if (!header.xml_is_last) return;
    const std::string before = read_xml(file_, header), xml = widened_bounds(before, find_extents());
    if (xml == before) return;
    tail_begin_ = static_cast<std::size_t>(header.xml_begin / kPayload * kPage);
    const std::uint64_t begin = to_logical(tail_begin_), end = header.xml_begin + xml.size();
    tail_.assign(static_cast<std::size_t>((end - begin + kPayload - 1) / kPayload * kPage), '\0');
    tail_.replace(0, kPayload, file_.substr(tail_begin_, kPayload));
    write_pages(tail_, begin, header.xml_begin, xml.size(), xml.data());
    xml_length_ = xml.size();
  }

  std::vector<Extent> find_extents() const {
    std::vector<Extent> extents(source_.scans_.size());
    std::mutex guard;
    for_each_block(source_.block_count(), [&](std::size_t b) {
      const auto& [scan, first, count] = source_.blocks_[b];
      const Moved moved = find_moved(source_.scans_[scan], first, first + count);
      Extent extent;
      for (std::size_t i = 0; i < moved.changed.size(); ++i) {
        if (moved.changed[i] == 0) continue;
        extent.cartesian.add(moved.cartesian[i]);
        if (!moved.spherical.empty()) extent.spherical.add(moved.spherical[i]);
      }
      const std::lock_guard lock(guard);
      extents[scan].add(extent);
    });
    return extents;
  }

  void append_window(std::size_t begin, std::string& buffer) {
    buffer.assign(file_.substr(begin, kWindow));
    bool changed = false;
    if (!tail_.empty() && begin + kWindow > tail_begin_) {
      buffer.resize(begin < tail_begin_ ? tail_begin_ - begin : 0);
      const std::size_t done = begin < tail_begin_ ? 0 : begin - tail_begin_;
      buffer.append(tail_, done, kWindow - buffer.size());
      changed = true;
    }
    if (!tail_.empty() && begin == 0) {  // where the lengths of the file and of its XML section are
      store_little(buffer.data() + 16, std::uint64_t{tail_begin_ + tail_.size()});
      store_little(buffer.data() + 32, xml_length_);
      changed = true;
    }
    const std::uint64_t from = to_logical(begin), to = from + buffer.size() / kPage * kPayload;
    for (const ScanPoints& scan : source_.scans_) changed |= patch_scan(scan, from, to, buffer);
    if (changed) seal_pages(buffer);
  }

  static std::vector<Overlap> overlaps(const std::vector<Piece>& pieces, std::uint64_t from, std::uint64_t to) {
    std::vector<Overlap> result;
    auto piece = std::ranges::upper_bound(pieces, from, {}, [](const Piece& p) { return p.place + p.size; });
    for (; piece != pieces.end() && piece->place < to; ++piece)
      result.push_back({&*piece, std::max(from, piece->place), std::min(to, piece->place + piece->size)});
    return result;
  }

  // A field of a scan that is written, and where its values come from: a coordinate or new values of an attribute.
  struct Target {
    std::size_t field, axis;
    bool spherical;
    const Replacement* replacement;
  };

  std::vector<Target> targets(const ScanPoints& scan) const {
    std::vector<Target> result;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (scan.cartesian) result.push_back({(*scan.cartesian)[axis], axis, false, nullptr});
      if (scan.spherical) result.push_back({(*scan.spherical)[axis], axis, true, nullptr});
    }
    for (const Replacement& replacement : edits_.replaced) {
      for (std::size_t f = 0; f < scan.fields.size(); ++f)
        if (scan.fields[f].name == replacement.values->name) result.push_back({f, 0, false, &replacement});
    }
    std::erase_if(result, [&](const Target& target) { return scan.fields[target.field].bits == 0; });
    return result;
  }

  // Patches what of the scan lies between the logical places `from` and `to`, which `buffer` holds.
  bool patch_scan(const ScanPoints& scan, std::uint64_t from, std::uint64_t to, std::string& buffer) const {
    const std::vector<Target> fields = targets(scan);
    std::vector<std::vector<Overlap>> parts;
    std::uint64_t first = scan.records, last = 0;
    for (const Target& target : fields) {
      parts.push_back(overlaps(scan.streams[target.field], from, to));
      for (const auto& [piece, begin, end] : parts.back()) {
        const std::uint64_t bits = scan.fields[target.field].bits, bit = (piece->begin + (begin - piece->place)) * 8;
        first = std::min(first, bit / bits);
        last = std::max(last, std::min((bit + (end - begin) * 8 + bits - 1) / bits, scan.records));
      }
    }
    if (first >= last) return false;
    const Moved moved = find_moved(scan, first, last);
    const bool none = std::ranges::none_of(moved.changed, [](std::uint8_t c) { return c != 0; });
    for (std::size_t f = 0; f < fields.size(); ++f) {
      if (none && !fields[f].replacement) continue;
      for (const Overlap& part : parts[f]) patch_part(scan, fields[f], part, moved, first, from, buffer);
    }
    return !none || !edits_.replaced.empty();
  }

  void patch_part(const ScanPoints& scan, const Target& target, const Overlap& part, const Moved& moved,
                  std::uint64_t first, std::uint64_t window, std::string& buffer) const {
    const auto size = static_cast<std::size_t>(part.to - part.from);
    std::string bytes(size, '\0');
    read_pages(buffer, window, part.from, size, bytes.data());
    const Field& field = scan.fields[target.field];
    const auto begin = static_cast<std::int64_t>((part.piece->begin + (part.from - part.piece->place)) * 8);
    const std::uint64_t record = static_cast<std::uint64_t>(begin) / field.bits;
    const std::uint64_t end = std::min<std::uint64_t>(
        first + moved.changed.size(), (static_cast<std::uint64_t>(begin) + size * 8 + field.bits - 1) / field.bits);
    for (std::uint64_t r = record; r < end; ++r) {
      const auto i = static_cast<std::size_t>(r - first);
      if (!target.replacement && moved.changed[i] == 0) continue;
      const double value = target.replacement ? target.replacement->value(scan.first_point + r, 0)
                           : target.spherical ? moved.spherical[i][target.axis]
                                              : moved.cartesian[i][target.axis];
      put_bits(bytes.data(), size, static_cast<std::int64_t>(r * field.bits) - begin, field.bits,
               bits_of(field, value));
    }
    write_pages(buffer, window, part.from, size, bytes.data());
  }

  // Where the points of the records [first, last) of a scan went.
  Moved find_moved(const ScanPoints& scan, std::uint64_t first, std::uint64_t last) const {
    const auto count = static_cast<std::size_t>(last - first);
    std::vector<Position> own(count);
    source_.read_positions(scan, first, own);
    const Moves moves = source_.moves(scan.first_point + first, own, edits_);
    Moved moved;
    moved.changed = moves.changed;
    moved.cartesian.resize(count);
    read_coordinates(file_, scan, first, moved.cartesian);
    if (!scan.cartesian) std::ranges::transform(moved.cartesian, moved.cartesian.begin(), from_spherical);
    std::vector<double> azimuths(count);
    if (scan.spherical) {
      moved.spherical.resize(count);
      read_values(file_, scan, (*scan.spherical)[1], first, azimuths);
    }
    for (std::size_t i = 0; i < count; ++i) {
      if (moved.changed[i] == 0) continue;
      Position shift{};
      for (std::size_t axis = 0; axis < 3; ++axis) shift[axis] = moves.values[i][axis] - own[i][axis];
      shift = turned_back(scan.pose, shift);
      for (std::size_t axis = 0; axis < 3; ++axis) moved.cartesian[i][axis] += shift[axis];
      if (scan.spherical)
        moved.spherical[i] = stored(scan, *scan.spherical, to_spherical(moved.cartesian[i], azimuths[i]));
      if (scan.cartesian) moved.cartesian[i] = stored(scan, *scan.cartesian, moved.cartesian[i]);
    }
    return moved;
  }

  // The coordinates as the fields hold them.
  static Position stored(const ScanPoints& scan, const std::array<std::size_t, 3>& fields, Position position) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const Field& field = scan.fields[fields[axis]];
      position[axis] = value_of(field, bits_of(field, position[axis]));
    }
    return position;
  }

  const E57Source& source_;
  std::string_view file_;
  const Edits& edits_;
  Output& out_;
  std::size_t tail_begin_ = 0;
  std::string tail_;  // the pages from there on, where they are other than the file's
  std::uint64_t xml_length_ = 0;
};

void E57Source::write(const Edits& edits, Encoding, Output& out) const {
  if (!edits.added.empty())
    fail(name(), "an E57 file takes no further attributes, and '" + edits.added.front()->name +
                     "' was added; write PLY, PCD or LAZ");
  E57Writer(*this, edits, out).write();
}

}  // namespace pointfair::io::e57
