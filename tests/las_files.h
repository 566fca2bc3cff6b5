// SPDX-License-Identifier: Apache-2.0
// LAS files made byte by byte from the specification: every version and point format, records before and behind the
// points, extra bytes of every type.
#pragma once

#include <cstdint>
#include <cstring>
#include <random>
#include <string>
#include <vector>

namespace pointfair::test {

struct LasSpec {
  unsigned minor = 2;   ///< LAS 1.minor
  unsigned format = 0;  ///< of the points
  std::uint32_t count = 100;
  bool records = true;       ///< before the points, with bytes of no record behind them
  bool extended = true;      ///< records behind the points, from LAS 1.4 on
  bool described = false;    ///< extra bytes of every type with their descriptions
  unsigned plain_extra = 0;  ///< extra bytes without description
  bool legacy_count = true;  ///< where the format allows it
  bool wild = false;         ///< coordinates anywhere in 32 bits, and any return numbers
  unsigned seed = 1;
};

inline constexpr std::size_t kLasRecordLengths[] = {20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67};
inline constexpr std::size_t kLasExtraSizes[] = {1, 1, 2, 2, 4, 4, 8, 8, 4, 8};  // of types 1 to 10

template <class T>
T las_get(const std::string& bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}
template <class T>
void las_put(std::string& bytes, std::size_t at, T value) {
  std::memcpy(bytes.data() + at, &value, sizeof value);
}

/// Where the points of a file are, by its header.
inline std::size_t las_points_begin(const std::string& bytes) { return las_get<std::uint32_t>(bytes, 96); }
inline std::size_t las_record_length(const std::string& bytes) { return las_get<std::uint16_t>(bytes, 105); }
inline std::uint64_t las_count(const std::string& bytes) {
  const bool wide = bytes[25] >= 4 && las_get<std::uint64_t>(bytes, 247) != 0;
  return wide ? las_get<std::uint64_t>(bytes, 247) : las_get<std::uint32_t>(bytes, 107);
}

inline std::string las_record(const std::string& user, unsigned id, const std::string& data, bool extended) {
  std::string record(extended ? 60 : 54, '\0');
  las_put<std::uint16_t>(record, 0, 0xAABB);
  std::memcpy(record.data() + 2, user.data(), user.size());
  las_put(record, 18, static_cast<std::uint16_t>(id));
  if (extended) {
    las_put<std::uint64_t>(record, 20, data.size());
  } else {
    las_put(record, 20, static_cast<std::uint16_t>(data.size()));
  }
  std::memcpy(record.data() + (extended ? 28 : 22), "made by the tests", 17);
  return record + data;
}

/// Descriptions of one, two and three of each type of extra bytes, one of them with scale and offset.
inline std::string las_descriptions() {
  std::string all;
  for (unsigned type = 1; type <= 30; ++type) {
    std::string one(192, '\0');
    one[2] = static_cast<char>(type);
    const std::string name = "extra " + std::to_string(type);
    std::memcpy(one.data() + 4, name.data(), name.size());
    if (type == 4) {
      one[3] = 8 | 16;
      las_put(one, 112, 0.25);
      las_put(one, 136, 100.0);
    }
    all += one;
  }
  return all;
}
inline std::size_t las_described_bytes() {
  std::size_t bytes = 0;
  for (unsigned type = 0; type < 30; ++type) bytes += kLasExtraSizes[type % 10] * (1 + type / 10);
  return bytes;
}

class LasPoints {
 public:
  LasPoints(const LasSpec& spec, std::size_t record_length)
      : spec_(spec), record_length_(record_length), random_(spec.seed) {}

  std::string next() {
    std::string record(record_length_, '\0');
    for (std::size_t axis = 0; axis < 3; ++axis) {
      place_[axis] = spec_.wild ? static_cast<std::int32_t>(random_()) : place_[axis] + pick(2000) - 1000;
      las_put(record, 4 * axis, place_[axis]);
    }
    las_put(record, 12, static_cast<std::uint16_t>(pick(65536)));
    const bool wide = spec_.format >= 6;
    const int most = wide ? 15 : 5, returns = spec_.wild ? pick(16) : 1 + (pick(4) == 0 ? pick(most) : 0);
    const int number = spec_.wild ? pick(16) : 1 + pick(returns);
    record[14] = static_cast<char>(wide ? number | returns << 4 : (number & 7) | (returns & 7) << 3 | pick(4) << 6);
    record[15] = static_cast<char>(wide ? pick(16) | (pick(8) == 0 ? pick(4) : 0) << 4 | pick(4) << 6 : pick(256));
    record[16] = static_cast<char>(pick(spec_.wild ? 256 : 20));
    for (std::size_t at = 17; at < (wide ? 22U : 20U); ++at)
      record[at] = static_cast<char>(pick(8) == 0 ? pick(256) : 7);
    std::size_t at = wide ? 22 : 20;
    if (wide || spec_.format == 1 || spec_.format >= 3) {
      if (pick(3) != 0) time_ += pick(8) == 0 ? 1e-3 * pick(1000000) : 1e-5;
      las_put(record, at, pick(500) == 0 ? 1e9 * pick(9) : time_);
      at += 8;
    }
    for (; at < record_length_; ++at) record[at] = static_cast<char>(pick(4) == 0 ? pick(256) : 0);
    return record;
  }

 private:
  int pick(int below) { return static_cast<int>(random_() % static_cast<unsigned>(below)); }

  const LasSpec& spec_;
  std::size_t record_length_;
  std::mt19937 random_;
  std::int32_t place_[3] = {100000, -200000, 3000};
  double time_ = 2e5;
};

/// The bounds and the counts of returns, as the header has them.
inline void las_summarize(std::string& file, std::size_t begin, const LasSpec& spec, std::size_t length) {
  std::int32_t min[3] = {INT32_MAX, INT32_MAX, INT32_MAX}, max[3] = {INT32_MIN, INT32_MIN, INT32_MIN};
  std::uint64_t returns[16] = {};
  for (std::size_t i = 0; i < spec.count; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto value = las_get<std::int32_t>(file, begin + i * length + 4 * axis);
      min[axis] = std::min(min[axis], value);
      max[axis] = std::max(max[axis], value);
    }
    ++returns[file[begin + i * length + 14] & (spec.format >= 6 ? 15 : 7)];
  }
  for (std::size_t axis = 0; axis < 3 && spec.count > 0; ++axis) {
    const double scale = las_get<double>(file, 131 + 8 * axis), offset = las_get<double>(file, 155 + 8 * axis);
    las_put(file, 179 + 16 * axis, max[axis] * scale + offset);
    las_put(file, 187 + 16 * axis, min[axis] * scale + offset);
  }
  for (std::size_t r = 1; r <= 15 && spec.minor >= 4; ++r) las_put(file, 255 + 8 * (r - 1), returns[r]);
  for (std::size_t r = 1; r <= 5 && spec.format < 6; ++r)
    las_put(file, 111 + 4 * (r - 1), static_cast<std::uint32_t>(returns[r]));
}

inline std::string make_las(const LasSpec& spec) {
  const std::size_t header_size = (spec.minor >= 4 ? 375 : spec.minor == 3 ? 235 : 227) + (spec.seed % 2 ? 0 : 6);
  const std::size_t length =
      kLasRecordLengths[spec.format] + spec.plain_extra + (spec.described ? las_described_bytes() : 0);
  std::string file(header_size, '\0');
  std::memcpy(file.data(), "LASF", 4);
  las_put<std::uint16_t>(file, 6, spec.format >= 6 ? 0x11 : 1);
  file.replace(8, 16, "not quite a GUID");
  file[24] = 1;
  file[25] = static_cast<char>(spec.minor);
  file.replace(26, 9, "a scanner");
  file.replace(58, 15, "a generator 3.1");
  las_put<std::uint16_t>(file, 94, static_cast<std::uint16_t>(header_size));
  file[104] = static_cast<char>(spec.format);
  las_put(file, 105, static_cast<std::uint16_t>(length));
  if (spec.format < 6 && spec.legacy_count) las_put(file, 107, spec.count);
  const double scale[3] = {0.01, 0.01, 0.001}, offset[3] = {500000, 5400000, -12.5};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    las_put(file, 131 + 8 * axis, scale[axis]);
    las_put(file, 155 + 8 * axis, offset[axis]);
  }
  std::uint32_t records = 0;
  if (spec.records) {
    file += las_record("LASF_Projection", 2112, "PROJCS[\"Somewhere\",UNIT[\"metre\",1]]", false);
    file += las_record("someone", 77, std::string("\0\1\2 any bytes \xFF", 16), false);
    records = 2;
  }
  if (spec.described) {
    file += las_record("LASF_Spec", 4, las_descriptions(), false);
    ++records;
  }
  if (spec.records) file += "padding";
  las_put(file, 100, records);
  las_put(file, 96, static_cast<std::uint32_t>(file.size()));
  const std::size_t begin = file.size();
  LasPoints points(spec, length);
  for (std::uint32_t i = 0; i < spec.count; ++i) file += points.next();
  if (spec.minor >= 4) {
    las_put<std::uint64_t>(file, 247, spec.count);
    if (spec.extended) {
      las_put<std::uint64_t>(file, 235, file.size());
      las_put<std::uint32_t>(file, 243, 2);
      file += las_record("someone", 78, std::string(70000, 'x'), true);
      file += las_record("LASF_Spec", 65535, "waveform packets", true);
      las_put<std::uint64_t>(file, 227, file.size() - 76);
    }
  }
  las_summarize(file, begin, spec, length);
  return file;
}

/// All point formats, each in all versions that have it.
inline std::vector<LasSpec> all_las_specs() {
  const unsigned last_format[] = {1, 1, 3, 5, 10};
  std::vector<LasSpec> specs;
  for (unsigned minor = 0; minor <= 4; ++minor) {
    for (unsigned format = 0; format <= last_format[minor]; ++format) {
      LasSpec spec{.minor = minor, .format = format, .seed = 17 * minor + format + 1};
      specs.push_back(spec);
      spec.described = true;
      spec.plain_extra = 3;
      spec.legacy_count = minor < 4;
      specs.push_back(spec);
    }
  }
  return specs;
}

}  // namespace pointfair::test
