// SPDX-License-Identifier: Apache-2.0
// Writing a new E57 file (ASTM E2807): one scan in the coordinates of the cloud, with every attribute as a field.
// Fields that the standard does not know are those of an extension.
#include <algorithm>
#include <cmath>
#include <limits>

#include "io/box_of.hpp"
#include "io/column_names.hpp"
#include "io/e57/document.hpp"
#include "io/e57/pages.hpp"
#include "io/formats.hpp"
#include "pointfair/version.hpp"

namespace pointfair::io {
namespace e57 {
namespace {

constexpr std::size_t kFileHeader = 48, kSectionHeader = 32, kPacketHeader = 6, kMostOfPacket = 65536;

// One field of the records: its values, and how they are stored.
struct NewField {
  std::string name;
  NativeType type = NativeType::float64;
  const char* values = nullptr;
  std::size_t stride = 0;
  std::int64_t minimum = 0, maximum = 0;  ///< of an integer
  bool is_state = false;                  ///< cartesianInvalidState, two bits

  unsigned bits() const { return is_state ? 2 : static_cast<unsigned>(8 * size_of(type)); }
};

// Takes logical bytes and writes pages with their checksums.
class PageWriter {
 public:
  explicit PageWriter(Output& out) : out_(out) {}

  void write(std::string_view bytes) {
    pending_ += bytes;
    if (pending_.size() >= 256 * kPayload) write_pages_of(pending_.size() / kPayload);
  }
  void finish() {
    pending_.resize((pending_.size() + kPayload - 1) / kPayload * kPayload);
    write_pages_of(pending_.size() / kPayload);
  }

 private:
  void write_pages_of(std::size_t count) {
    std::string pages(count * kPage, '\0');
    write_pages(pages, 0, 0, count * kPayload, pending_.data());
    seal_pages(pages);
    out_.write(pages);
    pending_.erase(0, count * kPayload);
  }

  Output& out_;
  std::string pending_;
};

std::string number(double value) {
  std::string text;
  append_number(text, value);
  return text;
}

std::string element(const std::string& name, const std::string& type, const std::string& value) {
  return "<" + name + " type=\"" + type + "\">" + value + "</" + name + ">\n";
}

// What the standard calls an attribute.
std::string standard_name(const std::string& name) {
  static constexpr std::pair<std::string_view, const char*> kNames[] = {
      {"intensity", "intensity"},     {"red", "colorRed"},       {"green", "colorGreen"},
      {"blue", "colorBlue"},          {"nx", "nor:normalX"},     {"ny", "nor:normalY"},
      {"nz", "nor:normalZ"},          {"gps_time", "timeStamp"}, {"rowIndex", "rowIndex"},
      {"columnIndex", "columnIndex"}, {"timeStamp", "timeStamp"}};
  for (const auto& [known, standard] : kNames)
    if (name == known) return standard;
  return {};
}

// With no character that an element of XML cannot have.
std::string plain_name(const std::string& name) {
  std::string plain;
  for (const char c : name) {
    const bool is_letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
    const bool is_other = (c >= '0' && c <= '9') || c == '-' || c == '.';
    if (!is_letter && plain.empty()) plain += '_';
    if (is_letter || !plain.empty()) plain += is_letter || is_other ? c : '_';
  }
  return plain;
}

// As readers call the fields, which leave the prefix of the extension out.
NewNames e57_names(const std::vector<std::string>& columns) {
  return new_names(columns, {"cartesianX", "cartesianY", "cartesianZ", "cartesianInvalidState"}, standard_name,
                   plain_name);
}

// Integers have the range of their type, those of 64 bits that of their values.
void set_range(NewField& field) {
  with_type(field.type, [&](auto tag) {
    using T = decltype(tag);
    if constexpr (std::is_integral_v<T> && sizeof(T) < 8) {
      field.minimum = std::numeric_limits<T>::min();
      field.maximum = std::numeric_limits<T>::max();
    } else if constexpr (std::is_integral_v<T>) {
      field.minimum = std::numeric_limits<std::int64_t>::min();
      field.maximum = std::numeric_limits<std::int64_t>::max();
    }
  });
}

// E57 has integers up to those of int64.
void use_doubles_beyond_int64(TableColumn& column) {
  bool is_beyond = false;
  for (std::size_t at = 0; column.type == NativeType::uint64 && at < column.data.size(); at += sizeof(std::uint64_t))
    is_beyond = is_beyond || load<std::uint64_t>(column.data.data() + at, false) >> 63 != 0;
  if (is_beyond) change_values(column, NativeType::float64, [](std::size_t, double value) { return value; });
}

class NewFile {
 public:
  NewFile(Table table, const std::string& software) : table_(std::move(table)), software_(software) {
    use_ply_names(table_);
    const NativeType type = native(table_.coordinate_type);
    for (std::size_t axis = 0; axis < 3; ++axis)
      fields_.push_back({.name = std::string("cartesian") + "XYZ"[axis],
                         .type = type,
                         .values = reinterpret_cast<const char*>(table_.positions.data()) + axis * sizeof(double),
                         .stride = sizeof(Position)});
    const bool all_valid =
        std::ranges::all_of(table_.positions, [](const Position& p) { return std::isfinite(p[0] + p[1] + p[2]); });
    if (!all_valid)
      fields_.push_back({.name = "cartesianInvalidState", .type = NativeType::uint8, .maximum = 2, .is_state = true});
    const std::vector<std::string> names = e57_names(names_of(table_)).names;
    for (std::size_t c = 0; c < names.size(); ++c) {
      use_doubles_beyond_int64(table_.columns[c]);
      const bool is_standard = names[c] == standard_name(table_.columns[c].name);
      add_column(table_.columns[c], is_standard ? names[c] : kOwnPrefix + names[c]);
    }
    records_ = static_cast<std::size_t>((kMostOfPacket - kPacketHeader - 2 * fields_.size() - 4) * 8 / bits()) / 8 * 8;
    if (records_ == 0)
      throw Error(ErrorKind::usage, "the cloud has too many attributes for an E57 file; leave some out");
  }

  void write(Output& out) const {
    const std::uint64_t count = table_.size(), packets = (count + records_ - 1) / records_;
    const std::uint64_t last = count - (packets - 1) * records_;
    const std::uint64_t section = kSectionHeader + (packets - 1) * packet_size(records_) + packet_size(last);
    const std::string text = xml();
    const std::uint64_t xml_begin = kFileHeader + section, end = xml_begin + text.size();
    PageWriter pages(out);
    std::string front("ASTM-E57\1\0\0\0\0\0\0\0", 16);
    append_little(front, (end + kPayload - 1) / kPayload * kPage);
    append_little(front, to_physical(xml_begin));
    append_little(front, std::uint64_t{text.size()});
    append_little(front, std::uint64_t{kPage});
    front += std::string("\1\0\0\0\0\0\0\0", 8);
    append_little(front, section);
    append_little(front, to_physical(kFileHeader + kSectionHeader));
    append_little(front, std::uint64_t{0});  // no index: readers go from packet to packet
    pages.write(front);
    for (std::uint64_t packet = 0; packet < packets; ++packet)
      pages.write(packet_of(packet * records_, packet + 1 < packets ? records_ : last));
    pages.write(text);
    pages.finish();
  }

 private:
  std::size_t bits() const {
    std::size_t sum = 0;
    for (const NewField& field : fields_) sum += field.bits();
    return sum;
  }
  void add_column(const TableColumn& column, const std::string& name) {
    NewField& field = fields_.emplace_back(
        NewField{.name = name, .type = column.type, .values = column.data.data(), .stride = column_bytes(column)});
    set_range(field);
  }

  std::size_t packet_size(std::uint64_t records) const {
    std::size_t size = kPacketHeader + 2 * fields_.size();
    for (const NewField& field : fields_) size += (records * field.bits() + 7) / 8;
    return (size + 3) / 4 * 4;
  }

  std::string packet_of(std::uint64_t first, std::uint64_t count) const {
    std::string packet("\1\0", 2);
    append_little(packet, static_cast<std::uint16_t>(packet_size(count) - 1));
    append_little(packet, static_cast<std::uint16_t>(fields_.size()));
    for (const NewField& field : fields_)
      append_little(packet, static_cast<std::uint16_t>((count * field.bits() + 7) / 8));
    for (const NewField& field : fields_) append_stream(field, first, count, packet);
    packet.resize(packet_size(count));
    return packet;
  }

  void append_stream(const NewField& field, std::uint64_t first, std::uint64_t count, std::string& to) const {
    if (field.is_state) return append_states(first, count, to);
    const char* from = field.values + first * field.stride;
    const bool is_coordinate = field.stride == sizeof(Position) && &field < &fields_[3];
    with_type(field.type, [&](auto tag) {
      using T = decltype(tag);
      for (std::uint64_t i = 0; i < count; ++i, from += field.stride) {
        if (is_coordinate) {
          const double value = load<double>(from, false);
          append_little(to, static_cast<T>(std::isfinite(value) ? value : 0));
        } else if constexpr (std::is_integral_v<T>) {  // stored from the minimum on
          append_little(to, static_cast<std::make_unsigned_t<T>>(static_cast<std::uint64_t>(load<T>(from, false)) -
                                                                 static_cast<std::uint64_t>(field.minimum)));
        } else {
          append_little(to, load<T>(from, false));
        }
      }
    });
  }
  // 0: valid, 2: no coordinates.
  void append_states(std::uint64_t first, std::uint64_t count, std::string& to) const {
    for (std::uint64_t i = 0; i < count; i += 4) {
      unsigned byte = 0;
      for (std::uint64_t j = i; j < std::min(i + 4, count); ++j) {
        const Position& p = table_.positions[first + j];
        if (!std::isfinite(p[0] + p[1] + p[2])) byte |= 2U << 2 * (j - i);
      }
      to += static_cast<char>(byte);
    }
  }

  std::string xml() const {
    std::string text =
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<e57Root type=\"Structure\" "
        "xmlns=\"http://www.astm.org/COMMIT/E57/2010-e57-v1.0\" "
        "xmlns:nor=\"http://www.libe57.org/E57_NOR_surface_normals.txt\" xmlns:" +
        std::string(kOwnPrefix).substr(0, std::string_view(kOwnPrefix).size() - 1) + "=\"" + kOwnUri + "\">\n";
    text += element("formatName", "String", "ASTM E57 3D Imaging Data File");
    text += element("guid", "String", guid(0));
    text += element("versionMajor", "Integer", "1") + element("versionMinor", "Integer", "0");
    text += element("e57LibraryVersion", "String", software_) + element("coordinateMetadata", "String", "");
    text += "<data3D type=\"Vector\" allowHeterogeneousChildren=\"1\">\n<vectorChild type=\"Structure\">\n";
    text += element("guid", "String", guid(1)) + bounds() + limits();
    text += "<points type=\"CompressedVector\" fileOffset=\"" + std::to_string(to_physical(kFileHeader)) +
            "\" recordCount=\"" + std::to_string(table_.size()) + "\">\n<prototype type=\"Structure\">\n";
    for (const NewField& field : fields_) text += prototype(field);
    return text +
           "</prototype>\n<codecs type=\"Vector\" allowHeterogeneousChildren=\"1\"></codecs>\n</points>\n"
           "</vectorChild>\n</data3D>\n<images2D type=\"Vector\" allowHeterogeneousChildren=\"1\"></images2D>\n"
           "</e57Root>\n";
  }

  // The same cloud gives the same file.
  std::string guid(unsigned part) const {
    const auto* const bytes = reinterpret_cast<const char*>(table_.positions.data());
    const std::uint32_t sum = checksum({bytes, table_.positions.size() * sizeof(Position)});
    char text[64];
    std::snprintf(text, sizeof text, "{%08X-0000-4000-8000-%08X%04X}", sum, static_cast<unsigned>(table_.size()), part);
    return text;
  }

  std::string bounds() const {
    BoxOf<double> box;
    for (const Position& p : table_.positions)
      if (std::isfinite(p[0] + p[1] + p[2])) box.add(p);
    if (box.is_empty()) return {};
    std::string text = "<cartesianBounds type=\"Structure\">\n";
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::string name(1, "xyz"[axis]);
      text += element(name + "Minimum", "Float", number(box.min[axis])) +
              element(name + "Maximum", "Float", number(box.max[axis]));
    }
    return text + "</cartesianBounds>\n";
  }

  // By which readers scale intensities and colours.
  std::string limits() const {
    std::string intensity, color;
    for (const NewField& field : fields_) {
      const bool is_intensity = field.name == "intensity", is_color = field.name.starts_with("color");
      if (!is_intensity && !is_color) continue;
      (is_intensity ? intensity : color) += limit(field);
    }
    if (!intensity.empty()) intensity = "<intensityLimits type=\"Structure\">\n" + intensity + "</intensityLimits>\n";
    if (!color.empty()) color = "<colorLimits type=\"Structure\">\n" + color + "</colorLimits>\n";
    return intensity + color;
  }
  std::string limit(const NewField& field) const {
    if (is_integer(field.type))
      return element(field.name + "Minimum", "Integer", std::to_string(field.minimum)) +
             element(field.name + "Maximum", "Integer", std::to_string(field.maximum));
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (std::size_t i = 0; i < table_.size(); ++i) {
      const double value = load_double(field.values + i * field.stride, field.type, false);
      if (!std::isfinite(value)) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
    if (low > high) low = high = 0;
    return element(field.name + "Minimum", "Float", number(low)) +
           element(field.name + "Maximum", "Float", number(high));
  }

  static std::string prototype(const NewField& field) {
    if (!is_integer(field.type)) {
      const char* const precision = field.type == NativeType::float32 ? "single" : "double";
      return "<" + field.name + " type=\"Float\" precision=\"" + precision + "\"/>\n";
    }
    return "<" + field.name + " type=\"Integer\" minimum=\"" + std::to_string(field.minimum) + "\" maximum=\"" +
           std::to_string(field.maximum) + "\"/>\n";
  }

  Table table_;
  std::string software_;
  std::vector<NewField> fields_;
  std::size_t records_ = 0;  ///< of a packet, a multiple of 8, so that each begins with a whole byte
};

}  // namespace
}  // namespace e57

std::vector<std::string> renamed_in_new_e57(const Cloud& cloud) { return e57::e57_names(ply_names(cloud)).renamed; }

void write_e57(Table table, const Writing&, Output& out) {
  e57::NewFile(std::move(table), "pointfair " + std::string(version())).write(out);
}

}  // namespace pointfair::io
