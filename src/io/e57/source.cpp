// SPDX-License-Identifier: Apache-2.0
#include "io/e57/source.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include "io/coordinate_names.hpp"
#include "io/e57/pages.hpp"
#include "io/file_bytes.hpp"
#include "io/formats.hpp"
#include "io/no_points.hpp"
#include "io/text.hpp"
#include "portable.hpp"

namespace pointfair::io {
namespace e57 {
namespace {

constexpr std::uint64_t kBlock = 16384;
constexpr const char* kScanColumn = "scan";

// The type that holds all values that the field may have.
NativeType type_of(const Field& field) {
  if (field.kind == Field::Kind::float32) return NativeType::float32;
  if (field.kind == Field::Kind::float64 || field.scaled) return NativeType::float64;
  for (const NativeType type : {NativeType::uint8, NativeType::int8, NativeType::uint16, NativeType::int16,
                                NativeType::uint32, NativeType::int32}) {
    const bool fits = with_type(type, [&](auto tag) {
      using Limits = std::numeric_limits<decltype(tag)>;
      if constexpr (sizeof tag < 8)
        return static_cast<double>(field.minimum) >= static_cast<double>(Limits::lowest()) &&
               static_cast<double>(field.maximum) <= static_cast<double>(Limits::max());
      return false;
    });
    if (fits) return type;
  }
  return NativeType::int64;
}

// As the attribute was called that became the field.
std::string name_of(const Field& field) {
  return field.name.starts_with(kOwnPrefix) ? field.name.substr(std::string_view(kOwnPrefix).size()) : field.name;
}

Position turned(const Pose& pose, const Position& p) {
  Position result{};
  for (std::size_t row = 0; row < 3; ++row) {
    const auto& r = pose.rotation[row];
    result[row] = r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + pose.translation[row];
  }
  return result;
}

}  // namespace

double value_of(const Field& field, std::uint64_t bits) {
  switch (field.kind) {
    case Field::Kind::float32:
      return std::bit_cast<float>(static_cast<std::uint32_t>(bits));
    case Field::Kind::float64:
      return std::bit_cast<double>(bits);
    default:
      return static_cast<double>(static_cast<std::int64_t>(bits + static_cast<std::uint64_t>(field.minimum))) *
                 field.scale +
             field.offset;
  }
}

void read_values(std::string_view file, const ScanPoints& scan, std::size_t index, std::uint64_t first,
                 std::span<double> out) {
  const Field& field = scan.fields[index];
  const std::uint64_t bits = field.bits, begin = first * bits / 8;
  thread_local std::string bytes;
  if (bits != 0) read_stream(file, scan.streams[index], begin, ((first + out.size()) * bits + 7) / 8, bytes);
  std::uint64_t at = first * bits - begin * 8;
  for (double& value : out) {
    value = value_of(field, get_bits(bytes.data(), at, field.bits));
    at += bits;
  }
}

void read_coordinates(std::string_view file, const ScanPoints& scan, std::uint64_t first, std::span<Position> out) {
  thread_local std::vector<double> values;
  values.resize(out.size());
  for (std::size_t axis = 0; axis < 3; ++axis) {
    read_values(file, scan, scan.coordinates()[axis], first, values);
    for (std::size_t i = 0; i < out.size(); ++i) out[i][axis] = values[i];
  }
}

Position from_spherical(const Position& s) {
  const double flat = s[0] * portable::cos(s[2]);
  return {flat * portable::cos(s[1]), flat * portable::sin(s[1]), s[0] * portable::sin(s[2])};
}

Position to_spherical(const Position& p, double near) {
  const double flat = portable::hypot(p[0], p[1]), range = portable::hypot(flat, p[2]);
  const double azimuth = portable::atan2(p[1], p[0]);
  const double turns = std::nearbyint((near - azimuth) / (2 * std::numbers::pi));
  return {range, azimuth + turns * 2 * std::numbers::pi, portable::atan2(p[2], flat)};
}

E57Source::E57Source(FileBytes file, std::string file_name, FileHeader header, Document document)
    : Source(std::move(file), std::move(file_name), Format::e57, Encoding::binary), header_(header) {
  library_ = std::move(document.library);
  coordinate_metadata_ = std::move(document.coordinate_metadata);
  images_ = document.images;
  std::uint64_t left = to_logical(bytes().size());  // for the sections of scans
  for (Scan& scan : document.scans) {
    ScanPoints points;
    static_cast<Scan&>(points) = std::move(scan);
    points.first_point = size_;
    check_plausible(points.records, size_, sizeof(Point), bytes().size(), name());
    points.streams = find_streams(bytes(), points, scans_.size(), left, name());
    for (std::uint64_t first = 0; first < points.records; first += kBlock)
      blocks_.push_back({scans_.size(), first, std::min(kBlock, points.records - first)});
    size_ += points.records;
    scans_.push_back(std::move(points));
  }
  if (size_ == 0) fail_without_points(name());
  find_columns();
}

// Those of all scans together, and which scan a point is of, where there are several.
void E57Source::find_columns() {
  for (const ScanPoints& scan : scans_) {
    for (std::size_t f = 0; f < scan.fields.size(); ++f) {
      const Field& field = scan.fields[f];
      const bool coordinate = field.name.starts_with("cartesian") || field.name.starts_with("spherical");
      if (field.kind == Field::Kind::other || (coordinate && !field.name.ends_with("InvalidState"))) continue;
      const auto same = std::ranges::find(columns_, name_of(field), &Column::name);
      if (same == columns_.end()) {
        columns_.push_back({name_of(field), type_of(field), 1, false, field.scaled});
      } else if (same->type != type_of(field)) {
        same->type = NativeType::float64;
      }
    }
  }
  if (scans_.size() > 1) columns_.push_back({kScanColumn, NativeType::uint32, 1});
}

void E57Source::read_positions(const ScanPoints& scan, std::uint64_t first, std::span<Position> out) const {
  read_coordinates(bytes(), scan, first, out);
  for (Position& position : out) {
    if (!scan.cartesian) position = from_spherical(position);
    if (!scan.pose.is_identity) position = turned(scan.pose, position);
  }
  if (!scan.invalid_state) return;
  thread_local std::vector<double> values;
  values.resize(out.size());
  read_values(bytes(), scan, *scan.invalid_state, first, values);
  for (std::size_t i = 0; i < out.size(); ++i)
    if (values[i] != 0) out[i].fill(std::numeric_limits<double>::quiet_NaN());
}

void E57Source::positions(std::size_t block, std::span<Position> out) const {
  read_positions(scans_[blocks_[block].scan], blocks_[block].first, out);
}

void E57Source::extract_block(std::size_t index, std::size_t number, std::span<char> out) const {
  const Column& column = columns_[index];
  const std::size_t size = size_of(column.type);
  const Block& block = blocks_[number];
  const ScanPoints& scan = scans_[block.scan];
  // What a scan does not have is not a number, or 0.
  std::vector<double> values(static_cast<std::size_t>(block.count), std::numeric_limits<double>::quiet_NaN());
  const auto field = std::ranges::find(scan.fields, column.name, name_of);
  if (field != scan.fields.end()) {
    read_values(bytes(), scan, static_cast<std::size_t>(field - scan.fields.begin()), block.first, values);
  } else if (column.name == kScanColumn) {
    std::ranges::fill(values, static_cast<double>(block.scan));
  }
  for (std::size_t i = 0; i < values.size(); ++i) store_double(out.data() + i * size, column.type, false, values[i]);
}

std::optional<Position> E57Source::sensor(std::size_t block) const {
  const ScanPoints& scan = scans_[blocks_[block].scan];
  return scan.has_pose ? std::optional(scan.pose.translation) : std::nullopt;
}

FileInfo E57Source::info() const {
  FileInfo result;
  result.metres_per_unit = 1;  // as the standard says
  result.rows.push_back({"software", library_});
  result.rows.push_back({"scans", std::to_string(scans_.size())});
  const auto poses = std::ranges::count_if(scans_, &ScanPoints::has_pose);
  result.rows.push_back({"poses", std::to_string(poses)});
  if (!coordinate_metadata_.empty()) result.rows.push_back({"coordinate_system", coordinate_metadata_});
  for (const ScanPoints& scan : scans_) {
    if (!scan.cartesian) continue;  // an angle's step in metres depends on the range; an empty scan may have neither
    for (const std::size_t f : *scan.cartesian) {
      const Field& field = scan.fields[f];
      if (field.kind == Field::Kind::integer) result.step = std::max(result.step, std::abs(field.scale));
    }
  }
  return result;
}

// Points whose state says that their coordinates are a direction only.
std::uint64_t E57Source::count_directions() const {
  constexpr double kDirection = 1;
  std::uint64_t count = 0;
  std::vector<double> states;
  for (const Block& block : blocks_) {
    const ScanPoints& scan = scans_[block.scan];
    if (!scan.invalid_state) continue;
    states.resize(static_cast<std::size_t>(block.count));
    read_values(bytes(), scan, *scan.invalid_state, block.first, states);
    count += static_cast<std::uint64_t>(std::ranges::count(states, kDirection));
  }
  return count;
}

std::vector<Content> E57Source::contents() const {
  std::vector<Content> result;
  const auto any = [&](const auto& has) { return std::ranges::any_of(scans_, has); };
  if (!coordinate_metadata_.empty()) result.push_back({ContentKind::coordinate_system, "the coordinate system"});
  if (any([](const ScanPoints& scan) { return !scan.pose.is_identity; }))
    result.push_back({ContentKind::poses, "the poses of scans"});
  if (any([](const ScanPoints& scan) { return scan.is_described; }))
    result.push_back({ContentKind::records, "the names and descriptions of scans"});
  if (images_ > 0) result.push_back({ContentKind::records, counted(images_, "image")});
  if (const std::uint64_t directions = count_directions(); directions > 0)
    result.push_back(
        {ContentKind::records, "the direction of " + counted(directions, "point") + " without a distance"});
  if (const std::string absent = absent_in_some(); !absent.empty())
    result.push_back({ContentKind::records, "the absence of " + absent + " in some scans, whose points get 0"});
  std::set<std::string> texts;
  for (const ScanPoints& scan : scans_)
    for (const Field& field : scan.fields)
      if (field.kind == Field::Kind::other && texts.insert(field.name).second)
        result.push_back({ContentKind::text, "the column of words " + io::quoted(field.name)});
  return result;
}

// Attributes of integers that have no value for the points of some scan.
std::string E57Source::absent_in_some() const {
  std::vector<std::string> absent;
  for (const Column& column : columns_) {
    const auto lacks = [&](const ScanPoints& scan) {
      return std::ranges::find(scan.fields, column.name, name_of) == scan.fields.end();
    };
    const bool says_zero = column.name == kScanColumn || column.name.ends_with("InvalidState");
    if (!says_zero && is_integer(column.type) && std::ranges::any_of(scans_, lacks)) absent.push_back(column.name);
  }
  return absent.empty() ? std::string() : listed(absent);
}

}  // namespace e57

std::shared_ptr<Source> read_e57(FileBytes bytes, const std::string& name, const Reading&) {
  const std::string_view view = bytes.view();
  const e57::FileHeader header = e57::parse_file_header(view, name);
  e57::check_pages(view, name);
  e57::Document document = e57::parse_document(e57::read_xml(view, header), name);
  return std::make_shared<e57::E57Source>(std::move(bytes), name, header, std::move(document));
}

}  // namespace pointfair::io
