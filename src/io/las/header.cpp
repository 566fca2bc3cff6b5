// SPDX-License-Identifier: Apache-2.0
#include "io/las/header.hpp"

#include <algorithm>
#include <cmath>

#include "io/file_bytes.hpp"
#include "io/no_points.hpp"

namespace pointfair::io::las {
namespace {

constexpr std::size_t kRecordHead = 54, kExtendedHead = 60;

// Formats 11 and up came later.
constexpr std::array<std::size_t, 11> kRecordLengths = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};

std::size_t least_header_size(unsigned minor) { return minor >= 5 ? 393 : minor == 4 ? 375 : minor == 3 ? 235 : 227; }

// The records from `at` on, as many of `count` as lie before `end`. Returns where the last ends.
std::size_t read_records(std::string_view bytes, std::size_t at, std::size_t end, std::uint64_t count, bool extended,
                         std::vector<Record>& records) {
  const std::size_t head = extended ? kExtendedHead : kRecordHead;
  for (; count > 0 && end - at >= head; --count) {
    Record record;
    record.user = get_text(bytes, at + 2, 16);
    record.id = get<std::uint16_t>(bytes, at + 18);
    record.begin = at;
    record.extended = extended;
    const std::uint64_t size =
        extended ? get<std::uint64_t>(bytes, at + 20) : std::uint64_t{get<std::uint16_t>(bytes, at + 20)};
    if (size > end - at - head) return at;
    record.data = bytes.substr(at + head, static_cast<std::size_t>(size));
    at += head + record.data.size();
    records.push_back(std::move(record));
  }
  return at;
}

class Parser {
 public:
  Parser(std::string_view bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  Header parse() {
    if (bytes_.size() < least_header_size(0)) fail(name_, "the file ends within its header; copy it again");
    read_layout();
    read_points();
    read_grid();
    read_all_records();
    return std::move(header_);
  }

 private:
  void read_layout() {
    header_.minor = get<std::uint8_t>(bytes_, place::minor);
    const unsigned major = get<std::uint8_t>(bytes_, place::major);
    if (major != 1 || header_.minor > 5)
      fail(name_, "is LAS " + std::to_string(major) + "." + std::to_string(header_.minor) +
                      "; versions 1.0 to 1.5 are known: convert it to one of them");
    header_.size = get<std::uint16_t>(bytes_, place::header_size);
    header_.points_begin = get<std::uint32_t>(bytes_, place::points_begin);
    if (header_.size < least_header_size(header_.minor))
      fail(name_, "its header names " + std::to_string(header_.size) + " bytes as its size, LAS 1." +
                      std::to_string(header_.minor) + " has " + std::to_string(least_header_size(header_.minor)) +
                      "; repair the header");
    if (header_.size > header_.points_begin) fail(name_, "its points begin within its header; repair the header");
    if (header_.points_begin > bytes_.size())
      fail(name_,
           "the file ends before its points, at byte " + std::to_string(header_.points_begin) + "; copy it again");
  }

  void read_points() {
    const unsigned format = get<std::uint8_t>(bytes_, place::point_format);
    header_.compressed = (format & 0x80) != 0;
    header_.point_format = format & 0x3F;
    if (header_.point_format >= kRecordLengths.size())
      fail(name_, "has point format " + std::to_string(header_.point_format) +
                      "; formats 0 to 10 are known: convert it to one of them");
    header_.record_length = get<std::uint16_t>(bytes_, place::record_length);
    if (header_.record_length < least_record_length(header_.point_format))
      fail(name_, "its header gives a point " + std::to_string(header_.record_length) + " bytes, point format " +
                      std::to_string(header_.point_format) + " takes " +
                      std::to_string(least_record_length(header_.point_format)) + "; repair the header");
    header_.count = get<std::uint32_t>(bytes_, place::legacy_count);
    // Zero in the older place if the points are too many for it or of a newer format.
    if (header_.minor >= 4) {
      const auto count = get<std::uint64_t>(bytes_, place::count);
      if (count != 0) header_.count = count;
    }
    if (header_.count == 0) fail_without_points(name_);
  }

  void read_grid() {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      auto& [scale, offset] = header_.scaling;
      scale[axis] = get<double>(bytes_, place::scale + 8 * axis);
      offset[axis] = get<double>(bytes_, place::offset + 8 * axis);
      if (!(scale[axis] > 0) || !std::isfinite(scale[axis] * 2147483648.0 + std::abs(offset[axis])))
        fail(name_, std::string("the scale or offset of ") + "xyz"[axis] +
                        " in its header is not one that gives coordinates; repair the header");
    }
  }

  void read_all_records() {
    const std::uint64_t count = get<std::uint32_t>(bytes_, place::record_count);
    header_.records_end = read_records(bytes_, header_.size, header_.points_begin, count, false, header_.records);
    if (header_.minor >= 3) {
      const auto begin = get<std::uint64_t>(bytes_, place::waveform_begin);
      if (begin >= header_.points_begin && begin < bytes_.size())
        header_.waveform_begin = static_cast<std::size_t>(begin);
    }
    if (header_.minor < 4) return;
    const std::uint64_t extended = get<std::uint32_t>(bytes_, place::extended_count);
    const auto begin = get<std::uint64_t>(bytes_, place::extended_begin);
    if (extended == 0) return;
    if (begin < header_.points_begin || begin > bytes_.size())
      fail(name_, "its header promises records behind the points, from byte " + std::to_string(begin) +
                      " on, where there are none; copy it again or repair the header");
    header_.extended_begin = static_cast<std::size_t>(begin);
    const std::size_t before = header_.records.size();
    read_records(bytes_, header_.extended_begin, bytes_.size(), extended, true, header_.records);
    if (header_.records.size() - before < extended)
      fail(name_, "its header promises " + std::to_string(extended) + " records behind the points, file ends after " +
                      std::to_string(header_.records.size() - before) + "; copy it again or repair the header");
  }

  std::string_view bytes_;
  const std::string& name_;
  Header header_;
};

}  // namespace

const Record* Header::find(std::string_view user, unsigned id) const {
  const auto found = std::ranges::find_if(records, [&](const Record& r) { return r.is(user, id); });
  return found == records.end() ? nullptr : &*found;
}

std::size_t least_record_length(unsigned point_format) { return kRecordLengths[point_format]; }

Header parse_header(std::string_view bytes, const std::string& name) { return Parser(bytes, name).parse(); }

}  // namespace pointfair::io::las
