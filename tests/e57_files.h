// SPDX-License-Identifier: Apache-2.0
// E57 files made byte by byte from the standard (ASTM E2807): pages, packets, bit streams, XML.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace pointfair::test {

/// A field of a scan's records with its values: of a float as they are, of an integer as stored, before scale and
/// offset.
struct E57Field {
  std::string name;
  std::string type;  ///< "single", "double", "integer", "scaled", or "string", of no sense
  std::vector<double> values;
  std::int64_t minimum = 0, maximum = 0;
  double scale = 1, offset = 0;
  std::string bounds;  ///< further attributes of its element
};

struct E57Scan {
  std::vector<E57Field> fields;
  std::string pose;    ///< its element
  std::string bounds;  ///< the element cartesianBounds
};

inline std::uint32_t e57_checksum(const char* bytes, std::size_t size) {  // bit by bit
  std::uint32_t crc = 0xFFFFFFFF;
  for (std::size_t i = 0; i < size; ++i) {
    crc ^= static_cast<unsigned char>(bytes[i]);
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 1) != 0 ? crc >> 1 ^ 0x82F63B78 : crc >> 1;
  }
  return ~crc;
}

inline std::string e57_pages(std::string logical) {
  logical.resize((logical.size() + 1019) / 1020 * 1020);
  std::string pages;
  for (std::size_t at = 0; at < logical.size(); at += 1020) {
    pages += logical.substr(at, 1020);
    const std::uint32_t sum = e57_checksum(logical.data() + at, 1020);
    for (int shift = 24; shift >= 0; shift -= 8) pages += static_cast<char>(sum >> shift & 255);
  }
  return pages;
}

inline std::uint64_t e57_physical(std::uint64_t logical) { return logical / 1020 * 1024 + logical % 1020; }

class E57Bits {
 public:
  void add(std::uint64_t value, unsigned bits) {
    for (unsigned b = 0; b < bits; ++b, ++count_) {
      if (count_ % 8 == 0) bytes_ += '\0';
      if ((value >> b & 1) != 0) bytes_.back() = static_cast<char>(bytes_.back() | 1 << count_ % 8);
    }
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
  std::uint64_t count_ = 0;
};

inline unsigned e57_bits(const E57Field& field) {
  if (field.type == "single") return 32;
  if (field.type == "double") return 64;
  return static_cast<unsigned>(std::bit_width(static_cast<std::uint64_t>(field.maximum - field.minimum)));
}

inline std::string e57_stream(const E57Field& field) {
  E57Bits bits;
  for (const double value : field.values) {
    if (field.type == "single") {
      bits.add(std::bit_cast<std::uint32_t>(static_cast<float>(value)), 32);
    } else if (field.type == "double") {
      bits.add(std::bit_cast<std::uint64_t>(value), 64);
    } else {
      bits.add(static_cast<std::uint64_t>(static_cast<std::int64_t>(value) - field.minimum), e57_bits(field));
    }
  }
  return bits.bytes();
}

template <class T>
void e57_append(std::string& to, T value) {
  char bytes[sizeof(T)];
  std::memcpy(bytes, &value, sizeof value);
  to.append(bytes, sizeof value);
}

/// The section of a scan's points, which begins at this logical place: packets of at most `piece` bytes a field, with
/// an empty one and an index among them.
inline std::string e57_section(const E57Scan& scan, std::uint64_t begin, std::size_t piece) {
  std::vector<std::string> streams;
  std::size_t longest = 0;
  for (const E57Field& field : scan.fields) {
    streams.push_back(e57_stream(field));
    longest = std::max(longest, streams.back().size());
  }
  std::string packets;
  for (std::size_t at = 0; at < longest; at += piece) {
    std::string sizes, data;
    for (const std::string& stream : streams) {
      const std::string part = at < stream.size() ? stream.substr(at, piece) : std::string();
      e57_append(sizes, static_cast<std::uint16_t>(part.size()));
      data += part;
    }
    std::string packet("\1\0\0\0", 4);
    e57_append(packet, static_cast<std::uint16_t>(streams.size()));
    packet += sizes + data;
    packet.resize((packet.size() + 3) / 4 * 4);
    const auto length = static_cast<std::uint16_t>(packet.size() - 1);
    std::memcpy(packet.data() + 2, &length, 2);
    packets += packet;
    if (at == 0) packets += std::string("\2\0\x07\0....", 8) + std::string("\0\0\x0f\0", 4) + std::string(12, 'i');
  }
  std::string section("\1\0\0\0\0\0\0\0", 8);
  e57_append(section, static_cast<std::uint64_t>(32 + packets.size()));
  e57_append(section, e57_physical(begin + 32));
  e57_append(section, std::uint64_t{0});
  return section + packets;
}

inline std::string e57_number(double value) {
  char text[64];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

inline std::string e57_prototype(const E57Field& field) {
  std::string text = "<" + field.name;
  if (field.type == "single" || field.type == "double") {
    text += " type=\"Float\" precision=\"" + field.type + "\"";
  } else if (field.type == "string") {
    text += " type=\"String\"";
  } else {
    text += field.type == "scaled" ? " type=\"ScaledInteger\"" : " type=\"Integer\"";
    text += " minimum=\"" + std::to_string(field.minimum) + "\" maximum=\"" + std::to_string(field.maximum) + "\"";
    if (field.type == "scaled")
      text += " scale=\"" + e57_number(field.scale) + "\" offset=\"" + e57_number(field.offset) + "\"";
  }
  return text + field.bounds + "/>\n";
}

inline std::string make_e57(const std::vector<E57Scan>& scans, std::size_t piece = 97) {
  std::string logical(48, '\0'), xml =
                                     "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<e57Root type=\"Structure\" "
                                     "xmlns=\"http://www.astm.org/COMMIT/E57/2010-e57-v1.0\" "
                                     "xmlns:nor=\"http://www.libe57.org/E57_NOR_surface_normals.txt\">\n"
                                     "<e57LibraryVersion type=\"String\"><![CDATA[made by the "
                                     "tests]]></e57LibraryVersion>\n<data3D type=\"Vector\">\n";
  for (const E57Scan& scan : scans) {
    logical.resize((logical.size() + 3) / 4 * 4);
    xml += "<vectorChild type=\"Structure\">" + scan.pose + scan.bounds +
           "<points type=\"CompressedVector\" fileOffset=\"" + std::to_string(e57_physical(logical.size())) +
           "\" recordCount=\"" + std::to_string(scan.fields.front().values.size()) +
           "\"><prototype type=\"Structure\">\n";
    for (const E57Field& field : scan.fields) xml += e57_prototype(field);
    xml += "</prototype><codecs type=\"Vector\"/></points></vectorChild>\n";
    logical += e57_section(scan, logical.size(), piece);
    logical += std::string(8, '\0').append("a blob of some image").append(300, '\xAB');
  }
  xml += "</data3D>\n<images2D type=\"Vector\"/></e57Root>\n";
  const std::uint64_t xml_begin = logical.size();
  logical += xml;
  const std::uint64_t pages = (logical.size() + 1019) / 1020;
  std::string header("ASTM-E57\1\0\0\0\0\0\0\0", 16);
  for (const std::uint64_t number :
       {pages * 1024, e57_physical(xml_begin), std::uint64_t{xml.size()}, std::uint64_t{1024}}) {
    e57_append(header, number);
  }
  logical.replace(0, 48, header);
  return e57_pages(logical);
}

}  // namespace pointfair::test
