// SPDX-License-Identifier: Apache-2.0
// Writing COPC (Cloud Optimized Point Cloud, specification 1.0): LAZ of point formats 6 to 8 whose chunks are the nodes
// of an octree, with a record that describes it and one that says where each node is.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "io/formats.hpp"
#include "io/las/coordinate_system.hpp"
#include "io/las/frame.hpp"
#include "io/las/laz.hpp"
#include "io/las/octree.hpp"
#include "io/parallel.hpp"

namespace pointfair::io {
namespace las {
namespace {

constexpr std::size_t kHeaderSize = 375, kInfoSize = 160, kExtendedHead = 60, kWkt = 16;
constexpr double kDegreesPerAngle = 0.006;  // of the scan angle of formats from 6 on
constexpr unsigned kWaveDescriptors[] = {100, 355};

// The point format that COPC allows and that holds all fields of this one.
unsigned copc_format(unsigned format) {
  constexpr unsigned kFormats[] = {6, 6, 7, 7, 0, 0, 6, 7, 8};
  if (format < std::size(kFormats) && kFormats[format] != 0) return kFormats[format];
  throw Error(ErrorKind::usage,
              "COPC files have no place for wave packets (point format " + std::to_string(format) + "); write LAZ");
}

// A record of the formats 0 to 3 as one of 6 or 7, whose bytes are zero.
void widen(const char* from, unsigned format, std::size_t extra, char* to) {
  std::memcpy(to, from, 14);  // X, Y, Z, intensity
  const auto returns = static_cast<unsigned char>(from[14]), classes = static_cast<unsigned char>(from[15]);
  to[14] = static_cast<char>((returns & 7) | (returns >> 3 & 7) << 4);
  to[15] = static_cast<char>(classes >> 5 | (returns & 0xC0));
  to[16] = static_cast<char>(classes & 31);
  to[17] = from[17];
  const double degrees = static_cast<signed char>(from[16]);
  store_double(to + 18, NativeType::int16, kBigEndian, degrees / kDegreesPerAngle);
  std::memcpy(to + 20, from + 18, 2);
  const bool has_time = format == 1 || format == 3, has_color = format >= 2;
  if (has_time) std::memcpy(to + 22, from + 20, 8);
  if (has_color) std::memcpy(to + 30, from + (has_time ? 28 : 20), 6);
  std::memcpy(to + least_record_length(copc_format(format)), from + least_record_length(format), extra);
}

class CopcFile {
 public:
  CopcFile(std::string_view las, const std::string& name)
      : las_(las),
        header_(parse_header(las, name)),
        format_(copc_format(header_.point_format)),
        extra_(header_.record_length - least_record_length(header_.point_format)),
        record_length_(least_record_length(format_) + extra_),
        records_(las.substr(header_.points_begin)) {
    if (header_.count > std::numeric_limits<std::uint32_t>::max())
      throw Error(ErrorKind::usage, "a COPC file is written of at most 4294967295 points; cut the cloud");
    compression_ = usual_compression(format_, record_length_);
    compression_.chunk_points = 0;
    see_points();
    nodes_ = make_octree(cube_, static_cast<std::size_t>(header_.count), [this](std::size_t i) { return position(i); });
  }

  void write(Output& out) {
    std::string front = make_front();
    const std::size_t info = kHeaderSize + 54;
    out.write(front);
    out.write(std::string(8, '\0'));
    std::vector<std::size_t> sizes(nodes_.size());
    write_blocks(out, nodes_.size(), [&](std::size_t n, std::string& buffer) {
      encode_chunk(compression_, records_of(nodes_[n]), buffer);
      sizes[n] = buffer.size();
    });
    std::vector<std::uint32_t> counts(nodes_.size());
    std::ranges::transform(nodes_, counts.begin(),
                           [](const OctreeNode& node) { return static_cast<std::uint32_t>(node.points.size()); });
    std::uint64_t end = front.size() + 8;
    const std::string hierarchy = hierarchy_of(sizes, end);
    for (const std::size_t size : sizes) end += size;
    const std::string table = chunk_table(compression_, sizes, counts);
    std::string place;
    append_little(place, end);
    out.patch(front.size(), place);
    out.write(table);
    end += table.size();
    put(front, place::extended_begin, end);
    put(front, info + 40, end + kExtendedHead);
    put(front, info + 48, std::uint64_t{hierarchy.size()});
    out.write(extended_record("copc", 1000, "EPT hierarchy", hierarchy));
    for (const Record& record : header_.records)
      if (record.extended && is_kept(record)) out.write(las_.substr(record.begin, record.end() - record.begin));
    out.patch(0, front);
  }

 private:
  const char* record(std::size_t i) const { return records_.data() + i * header_.record_length; }

  Position position(std::size_t i) const {
    const Grid grid = get_grid(record(i));
    const Scaling& its = header_.scaling;
    return {its.value(0, grid[0]), its.value(1, grid[1]), its.value(2, grid[2])};
  }

  // The bounds and the numbers of returns that the header says.
  void see_points() {
    const unsigned old = header_.point_format;
    const bool has_time = old == 1 || old == 3 || old >= 6;
    const std::size_t time_at = old >= 6 ? 22 : 20;
    for (std::size_t i = 0; i < header_.count; ++i) {
      box_.add(position(i));
      ++returns_[static_cast<unsigned char>(record(i)[14]) & (old >= 6 ? 15 : 7)];
      const double time = has_time ? load_little<double>(record(i) + time_at) : 0;
      if (!std::isfinite(time)) continue;
      least_time_ = std::min(least_time_, time);
      most_time_ = std::max(most_time_, time);
    }
    if (least_time_ > most_time_) least_time_ = most_time_ = 0;
    cube_ = cube_around(box_.min, box_.max);
  }

  std::string records_of(const OctreeNode& node) const {
    std::string bytes(node.points.size() * record_length_, '\0');
    for (std::size_t i = 0; i < node.points.size(); ++i) {
      const char* const from = record(node.points[i]);
      char* const to = bytes.data() + i * record_length_;
      if (header_.point_format >= 6) {
        std::memcpy(to, from, record_length_);
      } else {
        widen(from, header_.point_format, extra_, to);
      }
    }
    return bytes;
  }

  static bool is_kept(const Record& record) {
    if (record.user == "copc" || record.is(kLaszipUser, kLaszipId)) return false;
    return record.user != "LASF_Spec" || record.id < kWaveDescriptors[0] || record.id >= kWaveDescriptors[1];
  }

  // The header, and the records before the points, that of the octree first.
  std::string make_front() {
    std::string front(las_.substr(0, std::min(header_.size, kHeaderSize)));
    front.resize(kHeaderSize);
    std::fill(front.begin() + place::legacy_count, front.begin() + place::scale, '\0');
    if (header_.minor < 4) std::fill(front.begin() + place::waveform_begin, front.end(), '\0');
    put<std::uint8_t>(front, place::minor, 4);
    put<std::uint16_t>(front, place::header_size, kHeaderSize);
    put<std::uint8_t>(front, place::point_format, static_cast<std::uint8_t>(format_ | 0x80));
    put(front, place::record_length, static_cast<std::uint16_t>(record_length_));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      put(front, place::bounds + 16 * axis, box_.max[axis]);
      put(front, place::bounds + 16 * axis + 8, box_.min[axis]);
    }
    put<std::uint64_t>(front, place::waveform_begin, 0);
    put(front, place::count, header_.count);
    for (std::size_t r = 1; r < returns_.size(); ++r) put(front, place::returns + 8 * (r - 1), returns_[r]);
    const bool has_keys = has_geotiff_keys(header_);
    const auto encoding = get<std::uint16_t>(front, place::global_encoding);
    put(front, place::global_encoding, static_cast<std::uint16_t>(has_keys ? encoding & ~kWkt : encoding | kWkt));
    front += make_record("copc", 1, "COPC info VLR", info());
    std::uint32_t records = 2, extended = 1;
    for (const Record& record : header_.records) {
      if (!is_kept(record)) continue;
      (record.extended ? extended : records) += 1;
      if (!record.extended) front += las_.substr(record.begin, record.end() - record.begin);
    }
    front += make_record(kLaszipUser, kLaszipId, "by LASzip of pointfair", compression_record(compression_));
    put(front, place::record_count, records);
    put(front, place::extended_count, extended);
    put(front, place::points_begin, static_cast<std::uint32_t>(front.size()));
    return front;
  }

  std::string info() const {
    std::string data;
    for (const double value : {cube_.center[0], cube_.center[1], cube_.center[2], cube_.half_side, cube_.spacing})
      append_little(data, value);
    append_little(data, std::uint64_t{0});  // where the hierarchy is, and its size: known in the end
    append_little(data, std::uint64_t{0});
    append_little(data, least_time_);
    append_little(data, most_time_);
    data.resize(kInfoSize);
    return data;
  }

  // One page with all nodes.
  std::string hierarchy_of(const std::vector<std::size_t>& sizes, std::uint64_t begin) const {
    std::string page;
    for (std::size_t n = 0; n < nodes_.size(); ++n) {
      append_little(page, nodes_[n].level);
      for (const std::int32_t at : nodes_[n].at) append_little(page, at);
      append_little(page, begin);
      append_little(page, static_cast<std::int32_t>(sizes[n]));
      append_little(page, static_cast<std::int32_t>(nodes_[n].points.size()));
      begin += sizes[n];
    }
    return page;
  }

  static std::string extended_record(std::string_view user, unsigned id, std::string_view title,
                                     const std::string& data) {
    std::string head(kExtendedHead, '\0');
    user.copy(head.data() + 2, 16);
    put(head, 18, static_cast<std::uint16_t>(id));
    put(head, 20, std::uint64_t{data.size()});
    title.copy(head.data() + 28, 32);
    return head + data;
  }

  std::string_view las_;
  Header header_;
  unsigned format_;  // as written
  std::size_t extra_, record_length_;
  std::string_view records_;
  Compression compression_;
  BoxOf<double> box_;
  std::array<std::uint64_t, 16> returns_{};
  double least_time_ = std::numeric_limits<double>::infinity(), most_time_ = -least_time_;
  Cube cube_;
  std::vector<OctreeNode> nodes_;
};

}  // namespace
}  // namespace las

void check_new_copc(const Cloud& cloud) {
  if (!cloud.source) return;
  for (const FileInfo::Row& row : cloud.source->info().rows)
    if (row.name == "point_format") las::copc_format(static_cast<unsigned>(std::stoul(row.value)));
}

void write_copc(std::string_view las, const std::string& name, Output& out) {
  las::CopcFile file(las, name);
  write_patched(out, [&](Output& to) { file.write(to); });
}

}  // namespace pointfair::io
