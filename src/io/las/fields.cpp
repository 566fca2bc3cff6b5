// SPDX-License-Identifier: Apache-2.0
#include "io/las/fields.hpp"

#include <algorithm>
#include <cstring>
#include <iterator>

#include "io/column_names.hpp"
#include "io/coordinate_names.hpp"
#include "io/formats.hpp"

namespace pointfair::io::las {
namespace {

constexpr std::size_t kDescription = 192, kWords = 160;  // where the words for people are in it
constexpr unsigned kHasScale = 8, kHasOffset = 16;

// Types 1 to 10 of extra bytes; 11 to 20 are two of them, 21 to 30 three.
constexpr NativeType kExtraTypes[] = {NativeType::uint8,   NativeType::int8,   NativeType::uint16, NativeType::int16,
                                      NativeType::uint32,  NativeType::int32,  NativeType::uint64, NativeType::int64,
                                      NativeType::float32, NativeType::float64};

// A field that the standard has; of a part of a byte also where its bits are.
struct StandardField {
  const char* name;
  NativeType type;
  std::size_t offset;
  unsigned shift = 0, bits = 0;
};
constexpr NativeType kByte = NativeType::uint8;
constexpr StandardField kOldBase[] = {{"intensity", NativeType::uint16, 12},
                                      {"return_number", kByte, 14, 0, 3},
                                      {"number_of_returns", kByte, 14, 3, 3},
                                      {"scan_direction_flag", kByte, 14, 6, 1},
                                      {"edge_of_flight_line", kByte, 14, 7, 1},
                                      {"classification", kByte, 15, 0, 5},
                                      {"synthetic", kByte, 15, 5, 1},
                                      {"key_point", kByte, 15, 6, 1},
                                      {"withheld", kByte, 15, 7, 1},
                                      {"scan_angle_rank", NativeType::int8, 16},
                                      {"user_data", kByte, 17},
                                      {"point_source_id", NativeType::uint16, 18}},
                        kNewBase[] = {{"intensity", NativeType::uint16, 12},
                                      {"return_number", kByte, 14, 0, 4},
                                      {"number_of_returns", kByte, 14, 4, 4},
                                      {"synthetic", kByte, 15, 0, 1},
                                      {"key_point", kByte, 15, 1, 1},
                                      {"withheld", kByte, 15, 2, 1},
                                      {"overlap", kByte, 15, 3, 1},
                                      {"scanner_channel", kByte, 15, 4, 2},
                                      {"scan_direction_flag", kByte, 15, 6, 1},
                                      {"edge_of_flight_line", kByte, 15, 7, 1},
                                      {"classification", kByte, 16},
                                      {"user_data", kByte, 17},
                                      {"scan_angle", NativeType::int16, 18},
                                      {"point_source_id", NativeType::uint16, 20},
                                      {"gps_time", NativeType::float64, 22}},
                        kTime[] = {{"gps_time", NativeType::float64, 0}},
                        kColor[] = {{"red", NativeType::uint16, 0},
                                    {"green", NativeType::uint16, 2},
                                    {"blue", NativeType::uint16, 4}},
                        kNearInfrared[] = {{"nir", NativeType::uint16, 0}},
                        kWavePacket[] = {{"wavepacket_index", kByte, 0},
                                         {"wavepacket_offset", NativeType::uint64, 1},
                                         {"wavepacket_size", NativeType::uint32, 9},
                                         {"return_point_wave_location", NativeType::float32, 13},
                                         {"x_t", NativeType::float32, 17},
                                         {"y_t", NativeType::float32, 21},
                                         {"z_t", NativeType::float32, 25}};

// In the order of records.
std::vector<Field> standard_fields(unsigned format) {
  std::vector<Field> fields;
  const auto add = [&](std::span<const StandardField> those, std::size_t begin) {
    for (const StandardField& its : those) {
      Field& field = fields.emplace_back(Field{{its.name, its.type}, begin + its.offset, its.type, its.shift});
      field.bits = its.bits;
    }
  };
  if (format < 6) {
    add(kOldBase, 0);
    const bool time = format == 1 || format >= 3;
    if (time) add(kTime, 20);
    if (format == 2 || format == 3 || format == 5) add(kColor, time ? 28 : 20);
    if (format >= 4) add(kWavePacket, format == 4 ? 28 : 34);
    return fields;
  }
  add(kNewBase, 0);
  if (format == 7 || format == 8 || format == 10) add(kColor, 30);
  if (format == 8 || format == 10) add(kNearInfrared, 36);
  if (format >= 9) add(kWavePacket, format == 9 ? 30 : 38);
  return fields;
}

// Under another name if there is one like it.
void add_unique(Field field, std::vector<Field>& fields) {
  const std::string name = field.name;
  for (int n = 2; std::ranges::find(fields, field.name, &Field::name) != fields.end(); ++n)
    field.name = name + "_" + std::to_string(n);
  fields.push_back(std::move(field));
}

// One description, of which `room` bytes a record are left; components 0: it does not fit, or is none.
Field extra_field(std::string_view text, std::size_t offset, std::size_t room) {
  const auto type = get<std::uint8_t>(text, 2), options = get<std::uint8_t>(text, 3);
  Field field;
  field.name = get_text(text, 4, kLongestLasName);
  if (field.name.empty()) field.name = "extra_bytes";
  field.components = type == 0 ? options : type <= 30 ? 1U + (type - 1U) / 10 : 0;
  field.type = field.stored = type == 0 ? NativeType::uint8 : kExtraTypes[(type - 1U) % 10];
  field.offset = offset;
  if (column_bytes(field) > room) field.components = 0;
  if (type == 0) return field;
  for (std::size_t c = 0; c < std::min<std::size_t>(field.components, 3); ++c) {
    if ((options & kHasScale) != 0) field.scale[c] = get<double>(text, 112 + 8 * c);
    if ((options & kHasOffset) != 0) field.add[c] = get<double>(text, 136 + 8 * c);
  }
  field.scaled = (options & (kHasScale | kHasOffset)) != 0;
  if (field.scaled) field.type = NativeType::float64;
  return field;
}

// The extra bytes that have a description, in their order.
std::vector<Field> described_fields(const Header& header) {
  std::vector<Field> fields;
  std::size_t at = least_record_length(header.point_format);
  const Record* const record = header.find("LASF_Spec", 4);
  std::string_view descriptions = record ? record->data : std::string_view();
  while (descriptions.size() >= kDescription && at < header.record_length) {
    fields.push_back(extra_field(descriptions.substr(0, kDescription), at, header.record_length - at));
    if (fields.back().components == 0) {
      fields.pop_back();
      break;
    }
    at += fields.back().components * size_of(fields.back().stored);
    descriptions.remove_prefix(kDescription);
  }
  return fields;
}

std::size_t end_of(const std::vector<Field>& described, const Header& header) {
  if (described.empty()) return least_record_length(header.point_format);
  return described.back().offset + described.back().components * size_of(described.back().stored);
}

std::string description(unsigned type, unsigned options, std::string_view name) {
  std::string bytes(kDescription, '\0');
  bytes[2] = static_cast<char>(type);
  bytes[3] = static_cast<char>(options);
  name.copy(bytes.data() + 4, kLongestLasName);
  if (name == "outlier") std::string_view("0 none 1 isolated 2 off 3 mixed").copy(bytes.data() + kWords, 32);
  return bytes;
}

}  // namespace

std::vector<Field> record_fields(const Header& header) {
  std::vector<Field> fields = standard_fields(header.point_format), described = described_fields(header);
  const std::size_t end = end_of(described, header);
  for (Field& field : described) add_unique(std::move(field), fields);
  if (end < header.record_length) {
    const auto left = static_cast<std::uint32_t>(header.record_length - end);
    add_unique({{"extra_bytes", kByte, left}, end, kByte}, fields);
  }
  return fields;
}

void extract_field(const Field& field, const char* records, std::size_t record_length, std::size_t count, char* to) {
  const std::size_t size = size_of(field.stored), shown_size = size_of(field.type);
  const auto mask = static_cast<unsigned char>((1U << field.bits) - 1);
  for (std::size_t i = 0; i < count; ++i) {
    const char* from = records + i * record_length + field.offset;
    if (field.bits != 0) {
      *to++ = static_cast<char>(static_cast<unsigned char>(*from) >> field.shift & mask);
      continue;
    }
    for (std::uint32_t c = 0; c < field.components; ++c, from += size, to += shown_size) {
      if (field.scaled) {
        const double value = load_double(from, field.stored, kBigEndian) * field.scale[c] + field.add[c];
        std::memcpy(to, &value, sizeof value);
      } else {
        copy_scalar(to, from, size, kBigEndian);
      }
    }
  }
}

std::vector<std::string> extra_names(const Header& header, const std::vector<Column>& added) {
  std::vector<std::string> names;
  for (const Field& field : record_fields(header)) names.push_back(field.name);
  const auto own = static_cast<std::ptrdiff_t>(names.size());
  for (const Column& column : added)
    std::ranges::copy(component_names(column.name, column.components), std::back_inserter(names));
  make_distinct(names, kLongestLasName);
  names.erase(names.begin(), names.begin() + own);
  return names;
}

std::string describe_extra_bytes(const Header& header, const std::vector<Column>& added) {
  const std::vector<Field> described = described_fields(header);
  const Record* const record = header.find("LASF_Spec", 4);
  std::string result(record ? record->data.substr(0, described.size() * kDescription) : std::string_view());
  std::size_t plain = header.record_length - end_of(described, header);
  for (; plain > 0; plain -= std::min<std::size_t>(plain, 255))
    result += description(0, static_cast<unsigned>(std::min<std::size_t>(plain, 255)), "extra_bytes");
  const std::vector<std::string> names = extra_names(header, added);
  std::size_t next = 0;
  for (const Column& column : added) {
    const auto* const type = std::ranges::find(kExtraTypes, column.type);
    for (std::uint32_t c = 0; c < column.components; ++c)
      result += description(static_cast<unsigned>(1 + (type - std::begin(kExtraTypes))), 0, names[next++]);
  }
  return result;
}

}  // namespace pointfair::io::las
