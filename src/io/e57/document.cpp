// SPDX-License-Identifier: Apache-2.0
#include "io/e57/document.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <limits>
#include <pugixml.hpp>

#include "io/e57/pages.hpp"
#include "io/file_bytes.hpp"
#include "io/scalar.hpp"
#include "io/text.hpp"

namespace pointfair::io::e57 {
namespace {

constexpr std::size_t kHeaderSize = 48;

class Parser {
 public:
  Parser(const std::string& xml, const std::string& name) : name_(name) {
    const pugi::xml_parse_result result = document_.load_buffer(xml.data(), xml.size());
    if (!result)
      fail(name_, std::string("its XML section is damaged, ") + result.description() + " at byte " +
                      std::to_string(result.offset) + " of it; copy the file again");
  }

  Document parse() {
    const pugi::xml_node root = document_.child("e57Root");
    if (!root) fail(name_, "its XML section has no e57Root; copy the file again");
    Document document;
    document.library = root.child_value("e57LibraryVersion");
    document.coordinate_metadata = root.child_value("coordinateMetadata");
    for (const pugi::xml_node scan : root.child("data3D").children("vectorChild"))
      document.scans.push_back(parse_scan(scan, document.scans.size()));
    const auto images = root.child("images2D").children("vectorChild");
    document.images = static_cast<std::uint64_t>(std::distance(images.begin(), images.end()));
    return document;
  }

 private:
  [[noreturn]] void fail_number(std::string_view text) const {
    fail(name_, "its XML section has " + quoted(text) + " where a number must stand; repair it");
  }

  double number(std::string_view text, double absent) const {
    text = without_blanks(text);
    if (text.empty()) return absent;
    const std::optional<double> value = to_number(text);
    if (!value || !std::isfinite(*value)) fail_number(text);
    return *value;
  }
  double element(const pugi::xml_node& parent, const char* child, double absent = 0) const {
    return number(parent.child_value(child), absent);
  }
  double attribute(const pugi::xml_node& node, const char* key, double absent) const {
    return number(node.attribute(key).value(), absent);
  }
  template <class T>
  T integer(const pugi::xml_node& node, const char* key, T absent) const {
    const std::string_view text = without_blanks(node.attribute(key).value());
    if (text.empty()) return absent;
    T value{};
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc() || end != text.data() + text.size()) fail_number(text);
    return value;
  }

  Scan parse_scan(const pugi::xml_node& node, std::size_t index) const {
    Scan scan;
    if (const pugi::xml_node pose = node.child("pose")) {
      scan.pose = parse_pose(pose);
      scan.has_pose = true;
    }
    for (const char* const key : {"name", "description", "sensorVendor", "sensorModel", "acquisitionStart"})
      scan.is_described = scan.is_described || node.child(key);
    const pugi::xml_node points = node.child("points");
    scan.records = integer<std::uint64_t>(points, "recordCount", 0);
    scan.section_begin = to_logical(integer<std::uint64_t>(points, "fileOffset", 0));
    add_fields(points.child("prototype"), scan.fields);
    scan.cartesian = find(scan, {"cartesianX", "cartesianY", "cartesianZ"});
    scan.spherical = find(scan, {"sphericalRange", "sphericalAzimuth", "sphericalElevation"});
    if (scan.records > 0 && !scan.cartesian && !scan.spherical)
      fail(name_,
           "scan " + std::to_string(index) + " has neither cartesian nor spherical coordinates; choose another file");
    const char* const state = scan.cartesian ? "cartesianInvalidState" : "sphericalInvalidState";
    const auto found = std::ranges::find(scan.fields, state, &Field::name);
    if (found != scan.fields.end()) scan.invalid_state = static_cast<std::size_t>(found - scan.fields.begin());
    return scan;
  }

  Pose parse_pose(const pugi::xml_node& node) const {
    Pose pose;
    const pugi::xml_node turn = node.child("rotation"), shift = node.child("translation");
    double w = element(turn, "w", turn ? 0 : 1), x = element(turn, "x"), y = element(turn, "y"), z = element(turn, "z");
    const double length = std::sqrt(w * w + x * x + y * y + z * z);
    if (!(length > 0) || !std::isfinite(length))
      fail(name_, "the rotation of a scan is not a unit quaternion; repair it");
    w /= length, x /= length, y /= length, z /= length;
    pose.rotation = {{{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                      {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                      {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}}};
    pose.translation = {element(shift, "x"), element(shift, "y"), element(shift, "z")};
    pose.is_identity = pose.rotation == Pose{}.rotation && pose.translation == Pose{}.translation;
    return pose;
  }

  // Streams are numbered in the order of the elements, those in structures included.
  void add_fields(const pugi::xml_node& parent, std::vector<Field>& fields) const {
    for (const pugi::xml_node node : parent.children()) {
      if (node.type() != pugi::node_element) continue;
      const std::string_view type = node.attribute("type").value();
      if (type == "Structure" || type == "Vector")
        fail(name_, "its points have fields within fields, which are not known; choose another file");
      fields.push_back(parse_field(node, type));
    }
  }

  Field parse_field(const pugi::xml_node& node, std::string_view type) const {
    Field field;
    field.name = node.name();
    if (type == "Float") {
      const bool single = std::string_view(node.attribute("precision").value()) == "single";
      field.kind = single ? Field::Kind::float32 : Field::Kind::float64;
      field.bits = single ? 32 : 64;
    } else if (type == "Integer" || type == "ScaledInteger") {
      using Limits = std::numeric_limits<std::int64_t>;
      field.kind = Field::Kind::integer;
      field.scaled = type == "ScaledInteger";
      field.minimum = integer<std::int64_t>(node, "minimum", Limits::min());
      field.maximum = integer<std::int64_t>(node, "maximum", Limits::max());
      if (field.maximum < field.minimum)
        fail(name_, "the field " + io::quoted(field.name) + " has an empty range; repair it");
      if (field.scaled) {
        field.scale = attribute(node, "scale", 1);
        field.offset = attribute(node, "offset", 0);
        if (field.scale == 0) fail(name_, "the field " + io::quoted(field.name) + " has the scale 0; repair it");
      }
      const auto range = static_cast<std::uint64_t>(field.maximum) - static_cast<std::uint64_t>(field.minimum);
      field.bits = static_cast<unsigned>(std::bit_width(range));
    }
    return field;
  }

  static std::optional<std::array<std::size_t, 3>> find(const Scan& scan, const std::array<const char*, 3>& names) {
    std::array<std::size_t, 3> result{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto found = std::ranges::find_if(scan.fields, [&](const Field& field) {
        return field.name == names[axis] && field.kind != Field::Kind::other;
      });
      if (found == scan.fields.end()) return std::nullopt;
      result[axis] = static_cast<std::size_t>(found - scan.fields.begin());
    }
    return result;
  }

  const std::string& name_;
  pugi::xml_document document_;
};

}  // namespace

FileHeader parse_file_header(std::string_view file, const std::string& name) {
  if (!file.starts_with("ASTM-E57")) fail(name, "is no E57 file: it does not begin with ASTM-E57; choose another file");
  if (file.size() < kPage) fail(name, "the file ends within its first page; copy it again");
  const auto number = [&](std::size_t at) { return load_little<std::uint64_t>(file.data() + at); };
  const std::uint64_t length = number(16), xml_begin = number(24), xml_length = number(32), page = number(40);
  if (page != kPage) fail(name, "has pages of " + std::to_string(page) + " bytes; only pages of 1024 are known");
  if (length > file.size())
    fail(name, "its header promises " + std::to_string(length) + " bytes, file ends after " +
                   std::to_string(file.size()) + "; copy it again");
  const std::uint64_t pages = file.size() / kPage;
  FileHeader header;
  header.xml_begin = to_logical(xml_begin);
  header.xml_length = xml_length;
  if (xml_begin < kHeaderSize || xml_begin % kPage >= kPayload || xml_begin > file.size() ||
      xml_length > pages * kPayload - std::min(pages * kPayload, header.xml_begin)) {
    fail(name, "the file ends before its XML section; copy it again");
  }
  header.xml_is_last = (header.xml_begin + xml_length + kPayload - 1) / kPayload * kPage == file.size();
  return header;
}

std::string read_xml(std::string_view file, const FileHeader& header) {
  std::string xml(static_cast<std::size_t>(header.xml_length), '\0');
  read_pages(file, 0, header.xml_begin, xml.size(), xml.data());
  return xml;
}

Document parse_document(const std::string& xml, const std::string& name) { return Parser(xml, name).parse(); }

}  // namespace pointfair::io::e57
