// SPDX-License-Identifier: Apache-2.0
// Writing an E57 file back with moved points: the file as it is, with the bits of coordinates changed where they stand
// and the checksums of their pages renewed.
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <mutex>
#include <optional>
#include <pugixml.hpp>
#include <string_view>
#include <utility>

#include "io/box_of.hpp"
#include "io/contents.hpp"
#include "io/e57/pages.hpp"
#include "io/e57/source.hpp"
#include "io/file_bytes.hpp"
#include "io/parallel.hpp"
#include "io/text.hpp"

namespace pointfair::io::e57 {
namespace {

// The least and the greatest coordinates of points of a scan: x, y, z; range, azimuth, elevation.
struct Extent {
  BoxOf<double> cartesian, spherical;

  void add(const Extent& other) {
    cartesian.add(other.cartesian);
    spherical.add(other.spherical);
  }
};

constexpr std::array<const char*, 6> kFields = {"cartesianX",     "cartesianY",       "cartesianZ",
                                                "sphericalRange", "sphericalAzimuth", "sphericalElevation"};
// Elements of cartesianBounds and sphericalBounds; the azimuth's say where a sweep starts and ends, which is no bound.
constexpr std::array<const char*, 6> kBounds = {"x", "y", "z", "range", "", "elevation"};

// The XML section with each bound that a scan's extent exceeds moved out to it; all else as it is, and no shorter.
class Widener {
 public:
  explicit Widener(const std::string& xml) : xml_(xml) { document_.load_buffer(xml.data(), xml.size()); }

  std::string widen(const std::vector<Extent>& extents) {
    auto extent = extents.begin();
    for (const pugi::xml_node scan : document_.child("e57Root").child("data3D").children("vectorChild")) {
      if (extent == extents.end()) break;
      widen_scan(scan, *extent++);
    }
    return apply();
  }

 private:
  struct Edit {
    std::size_t begin, end;
    std::string text;
  };

  void widen_scan(const pugi::xml_node& scan, const Extent& extent) {
    for (std::size_t c = 0; c < kFields.size(); ++c) {
      const BoxOf<double>& box = c < 3 ? extent.cartesian : extent.spherical;
      const double least = box.min[c % 3], most = box.max[c % 3];
      if (least > most) continue;
      const pugi::xml_node field = scan.child("points").child("prototype").child(kFields[c]);
      if (std::string_view(field.attribute("type").value()) == "Float") {
        const bool single = std::string_view(field.attribute("precision").value()) == "single";
        widen_attribute(field, "minimum", least, true, single);
        widen_attribute(field, "maximum", most, false, single);
      }
      const std::string bound = kBounds[c];
      const pugi::xml_node bounds = scan.child(c < 3 ? "cartesianBounds" : "sphericalBounds");
      if (bound.empty()) continue;
      widen_element(bounds.child((bound + "Minimum").c_str()), least, true);
      widen_element(bounds.child((bound + "Maximum").c_str()), most, false);
    }
  }

  static bool exceeds(std::string_view bound, double value, bool lower) {
    const std::optional<double> number = bound.empty() ? 0.0 : to_number(bound);
    return number && (lower ? value < *number : value > *number);
  }

  void widen_attribute(const pugi::xml_node& node, const char* key, double value, bool lower, bool single) {
    const pugi::xml_attribute attribute = node.attribute(key);
    if (single) value = static_cast<float>(value);
    if (!attribute || !exceeds(attribute.value(), value, lower)) return;
    const auto tag = static_cast<std::size_t>(node.offset_debug());
    const std::size_t tag_end = xml_.find('>', tag), at = xml_.find(std::string(key) + "=", tag);
    if (at >= tag_end) return;
    const std::size_t quote = at + std::string_view(key).size() + 1, end = xml_.find(xml_[quote], quote + 1);
    if (end >= tag_end) return;
    edits_.push_back({quote + 1, end, text_of(value)});
  }

  // Only a Float: the range of an integer is that of its bits.
  void widen_element(const pugi::xml_node& node, double value, bool lower) {
    if (std::string_view(node.attribute("type").value()) != "Float" || !exceeds(node.child_value(), value, lower))
      return;
    const std::string name = node.name();
    const auto tag = static_cast<std::size_t>(node.offset_debug());
    std::size_t end = xml_.find('>', tag);
    if (end == std::string::npos) return;
    if (xml_[end - 1] != '/') {
      end = xml_.find('>', xml_.find("</" + name, end));
      if (end == std::string::npos) return;
    }
    edits_.push_back({tag - 1, end + 1, "<" + name + " type=\"Float\">" + text_of(value) + "</" + name + ">"});
  }

  static std::string text_of(double value) {
    std::string text;
    append_number(text, value);
    return text;
  }

  std::string apply() {
    if (edits_.empty()) return xml_;
    std::ranges::sort(edits_, {}, &Edit::begin);
    std::string result;
    PatchedText patched(xml_, result);
    for (const Edit& edit : edits_)
      patched.replace(std::string_view(xml_).substr(edit.begin, edit.end - edit.begin), edit.text);
    patched.finish();
    result.resize(std::max(result.size(), xml_.size()), '\n');
    return result;
  }

  const std::string& xml_;
  pugi::xml_document document_;
  std::vector<Edit> edits_;
};

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
  std::uint64_t held = 0;  // points that moved beyond what the fields can hold
};

// Where pieces of a stream lie in a window of the file: from `from` on, up to `to`, in logical places.
struct Overlap {
  const Piece* piece;
  std::uint64_t from, to;
};

}  // namespace

class E57Writer {
 public:
  E57Writer(const E57Source& source, const Edits& edits) : source_(source), file_(source.bytes()), edits_(edits) {}

  void write(Output& out) {
    replace_xml();
    const std::size_t length = tail_.empty() ? file_.size() : tail_begin_ + tail_.size();
    write_blocks(out, (length + kWindow - 1) / kWindow,
                 [&](std::size_t window, std::string& buffer) { append_window(window * kWindow, buffer); });
  }

  std::uint64_t count_held() const {
    std::atomic<std::uint64_t> held = 0;
    for_each_block(source_.block_count(), [&](std::size_t b) {
      const auto& [scan, first, count] = source_.blocks_[b];
      held += find_moved(source_.scans_[scan], first, first + count).held;
    });
    return held;
  }

 private:
  // Where points go beyond the bounds that the XML section names, it is written anew, if nothing follows it.
  void replace_xml() {
    const FileHeader& header = source_.header_;
    if (!header.xml_is_last) return;
    const std::string before = read_xml(file_, header), xml = Widener(before).widen(find_extents());
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
      bool is_held = false;
      // the coordinates as the fields hold them
      const auto store = [&](const std::array<std::size_t, 3>& fields, Position& position) {
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const Field& field = scan.fields[fields[axis]];
          const double wanted = std::exchange(position[axis], value_of(field, bits_of(field, position[axis])));
          is_held |= field.kind == Field::Kind::integer && std::abs(position[axis] - wanted) > field.scale;
        }
      };
      if (scan.spherical) store(*scan.spherical, moved.spherical[i] = to_spherical(moved.cartesian[i], azimuths[i]));
      if (scan.cartesian) store(*scan.cartesian, moved.cartesian[i]);
      moved.held += is_held;
    }
    return moved;
  }

  const E57Source& source_;
  std::string_view file_;
  const Edits& edits_;
  std::size_t tail_begin_ = 0;
  std::string tail_;  // the pages from there on, where they are other than the file's
  std::uint64_t xml_length_ = 0;
};

void E57Source::write(const Edits& edits, Encoding, Output& out) const {
  if (!edits.added.empty())
    fail(name(), "an E57 file takes no further attributes, and '" + edits.added.front()->name +
                     "' was added; write PLY, PCD or LAZ");
  E57Writer(*this, edits).write(out);
}

std::vector<std::string> E57Source::losses_of_moves(const Edits& edits) const {
  const auto has_range = [](const ScanPoints& scan) {
    return std::ranges::any_of(scan.coordinates(),
                               [&](std::size_t c) { return scan.fields[c].kind == Field::Kind::integer; });
  };
  if (edits.cloud.points.empty() || std::ranges::none_of(scans_, has_range)) return {};
  const std::uint64_t held = E57Writer(*this, edits).count_held();
  if (held == 0) return {};
  return {counted(held, "point") +
          " moved beyond the range that the E57 file declares for coordinates, and got the nearest place within; PLY "
          "and LAZ files have no such range"};
}

}  // namespace pointfair::io::e57
