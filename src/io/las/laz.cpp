// SPDX-License-Identifier: Apache-2.0
#include "io/las/laz.hpp"

#include <algorithm>

#include "io/file_bytes.hpp"
#include "io/las/integer_coder.hpp"
#include "io/las/interleaved.hpp"
#include "io/las/layered.hpp"

namespace pointfair::io::las {
namespace {

constexpr std::uint32_t kVariable = 0xFFFFFFFF;
constexpr std::size_t kFixedPart = 34, kItemBytes = 6;
enum Compressor : unsigned { kPointwise = 1, kChunked = 2, kLayered = 3 };

std::vector<Item> usual_items(unsigned format, std::size_t record_length) {
  std::vector<Item> items;
  if (format < 6) {
    items.push_back({Item::point10, 20, 2});
    if (format == 1 || format >= 3) items.push_back({Item::time11, 8, 2});
    if (format == 2 || format == 3 || format == 5) items.push_back({Item::color12, 6, 2});
    if (format >= 4) items.push_back({Item::wave13, 29, 1});
  } else {
    items.push_back({Item::point14, 30, 3});
    if (format == 7) items.push_back({Item::color14, 6, 3});
    if (format == 8 || format == 10) items.push_back({Item::color_nir14, 8, 3});
    if (format >= 9) items.push_back({Item::wave14, 29, 3});
  }
  const auto extra = static_cast<std::uint16_t>(record_length - least_record_length(format));
  if (extra > 0 && format < 6) items.push_back({Item::bytes, extra, 2});
  if (extra > 0 && format >= 6) items.push_back({Item::bytes14, extra, 3});
  return items;
}

bool is_known_version(const Item& item) {
  if (item.type >= Item::point14) return item.version == 3 || item.version == 4;
  return item.version == 1 || (item.version == 2 && item.type != Item::wave13);
}

[[noreturn]] void fail_compression(const std::string& name, const std::string& what) {
  fail(name, what + "; write it again with a current LASzip");
}

void check_items(const Compression& compression, const Header& header, const std::string& name) {
  const std::vector<Item> expected = usual_items(header.point_format, header.record_length);
  const bool same = std::ranges::equal(
      compression.items, expected, [](const Item& a, const Item& b) { return a.type == b.type && a.size == b.size; });
  if (!same) fail(name, "its points and its description of their compression do not agree; copy it again");
  for (const Item& item : compression.items) {
    if (!is_known_version(item))
      fail_compression(name, "its points are compressed in version " + std::to_string(item.version) + " of item " +
                                 std::to_string(item.type) + ", which is not known");
    if (item.version != compression.version() && item.type != Item::wave13)
      fail_compression(name, "the parts of its points are compressed in more than one version");
  }
}

// Where the table begins: in the 8 bytes before the first chunk or, if these could not be written, in the last 8.
std::size_t find_table(std::string_view bytes, const Header& header, const std::string& name) {
  if (bytes.size() < header.points_begin + 16) fail(name, "the file ends before its points; copy it again");
  auto begin = get<std::uint64_t>(bytes, header.points_begin);
  if (begin == ~std::uint64_t{0}) begin = get<std::uint64_t>(bytes, bytes.size() - 8);
  if (begin <= header.points_begin)
    fail(name,
         "has no table of its chunks, so its writing was interrupted; write it again, or repair it with LAStools");
  if (begin < header.points_begin + 8 || begin > bytes.size() - 8)
    fail(name, "the file ends before the table of its chunks, at byte " + std::to_string(begin) + "; copy it again");
  return static_cast<std::size_t>(begin);
}

}  // namespace

std::size_t Compression::record_length() const {
  std::size_t length = 0;
  for (const Item& item : items) length += item.size;
  return length;
}

std::size_t Compression::layers() const {
  std::size_t count = 0;
  for (const Item& item : items)
    count += item.type == Item::point14       ? 9
             : item.type == Item::color_nir14 ? 2
             : item.type == Item::bytes14     ? item.size
                                              : 1;
  return count;
}

void Compression::set_version(unsigned version) {
  for (Item& item : items)
    if (item.type != Item::wave13) item.version = static_cast<std::uint16_t>(version);
}

Compression usual_compression(unsigned point_format, std::size_t record_length) {
  return {kUsualChunk, usual_items(point_format, record_length)};
}

Compression read_compression(const Header& header, const std::string& name) {
  const Record* const record = header.find(kLaszipUser, kLaszipId);
  if (!record || record->data.size() < kFixedPart)
    fail(name, "its points are compressed, but the record that says how is missing; copy it again");
  const auto compressor = get<std::uint16_t>(record->data, 0), coder = get<std::uint16_t>(record->data, 2);
  const std::size_t items = get<std::uint16_t>(record->data, 32);
  const unsigned expected = header.point_format >= 6 ? kLayered : kChunked;
  const bool is_pointwise = compressor == kPointwise && header.point_format < 6;
  if ((compressor != expected && !is_pointwise) || coder != 0)
    fail_compression(name, "its points of format " + std::to_string(header.point_format) +
                               " are compressed by compressor " + std::to_string(compressor) + ", coder " +
                               std::to_string(coder) + ", which is not known");
  Compression result;
  result.pointwise = is_pointwise;
  result.chunk_points = get<std::uint32_t>(record->data, 12);
  if (result.chunk_points == kVariable) result.chunk_points = 0;
  if (items > (record->data.size() - kFixedPart) / kItemBytes)
    fail(name, "the record that says how its points are compressed is cut off; copy it again");
  for (std::size_t i = 0; i < items; ++i) {
    const std::size_t at = kFixedPart + kItemBytes * i;
    result.items.push_back({get<std::uint16_t>(record->data, at), get<std::uint16_t>(record->data, at + 2),
                            get<std::uint16_t>(record->data, at + 4)});
  }
  check_items(result, header, name);
  return result;
}

std::string compression_record(const Compression& compression) {
  std::string data;
  append_little<std::uint16_t>(data, compression.layered() ? kLayered : kChunked);
  append_little<std::uint16_t>(data, 0);  // arithmetic coder
  append_little<std::uint8_t>(data, 3);   // what LASzip 3.5 writes
  append_little<std::uint8_t>(data, 5);
  append_little<std::uint16_t>(data, 0);
  append_little<std::uint32_t>(data, 0);
  append_little<std::uint32_t>(data, compression.chunk_points == 0 ? kVariable : compression.chunk_points);
  append_little<std::int64_t>(data, -1);
  append_little<std::int64_t>(data, -1);
  append_little<std::uint16_t>(data, static_cast<std::uint16_t>(compression.items.size()));
  for (const Item& item : compression.items) {
    append_little(data, item.type);
    append_little(data, item.size);
    append_little(data, item.version);
  }
  return data;
}

ChunkTable read_chunk_table(std::string_view bytes, const Header& header, const Compression& compression,
                            const std::string& name) {
  ChunkTable table;
  table.begin = find_table(bytes, header, name);
  const std::uint64_t count = get<std::uint32_t>(bytes, table.begin + 4);
  std::string_view rest = bytes.substr(header.points_begin + 8, table.begin - header.points_begin - 8);
  // Each chunk holds its first point as it is.
  if (get<std::uint32_t>(bytes, table.begin) != 0 || count > rest.size() / header.record_length)
    fail(name, "the table of its chunks is damaged; copy it again");
  Decoder decoder(bytes.substr(table.begin + 8));
  IntegerCoder coder(2);
  std::uint64_t point = 0;
  std::int32_t points = 0, size = 0;
  table.chunks.reserve(static_cast<std::size_t>(count));
  for (std::uint64_t i = 0; i < count; ++i) {
    if (compression.chunk_points == 0) points = coder.code(decoder, points, 0, 0);
    size = coder.code(decoder, size, 0, 1);
    const std::uint64_t left = header.count - point;
    const std::uint64_t held = compression.chunk_points == 0 ? static_cast<std::uint32_t>(points)
                                                             : std::min<std::uint64_t>(compression.chunk_points, left);
    const std::size_t length = static_cast<std::uint32_t>(size);
    if (decoder.overrun() || held == 0 || held > left || length > rest.size() || length < header.record_length)
      fail(name, "the table of its chunks is damaged at chunk " + std::to_string(i) + "; copy it again");
    table.chunks.push_back({rest.substr(0, length), point, static_cast<std::uint32_t>(held)});
    rest.remove_prefix(length);
    point += held;
  }
  if (point != header.count)
    fail(name, "header promises " + std::to_string(header.count) + " points, its chunks hold " + std::to_string(point) +
                   "; copy it again or correct the header");
  table.end = std::min(bytes.size(), table.begin + 8 + (count == 0 ? 0 : decoder.position()));
  return table;
}

std::string chunk_table(const Compression& compression, std::span<const std::size_t> sizes,
                        std::span<const std::uint32_t> points) {
  std::string table;
  append_little<std::uint32_t>(table, 0);
  append_little<std::uint32_t>(table, static_cast<std::uint32_t>(sizes.size()));
  Encoder encoder(table);
  IntegerCoder coder(2);
  std::int32_t last_points = 0, last_size = 0;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    if (compression.chunk_points == 0)
      last_points = coder.code(encoder, last_points, static_cast<std::int32_t>(points[i]), 0);
    last_size = coder.code(encoder, last_size, static_cast<std::int32_t>(sizes[i]), 1);
  }
  encoder.finish();
  return table;
}

void encode_chunk(const Compression& compression, std::span<const char> records, std::string& to) {
  compression.layered() ? encode_layered(compression, records, to) : encode_interleaved(compression, records, to);
}

}  // namespace pointfair::io::las
