// SPDX-License-Identifier: Apache-2.0
// PNG (ISO/IEC 15948) with Deflate (RFC 1951) in a zlib frame (RFC 1950): one block of fixed codes, whose only matches
// are runs, at distance 1. The program needs no compression library for that, on any platform that it is built for.
#include "png.hpp"

#include <algorithm>
#include <string_view>

namespace pointfair::cli {
namespace {

void append_big_endian(std::string& bytes, std::uint32_t value) {
  for (const int shift : {24, 16, 8, 0}) bytes += static_cast<char>(value >> shift & 255);
}

std::uint32_t crc_of(std::string_view bytes) {
  static const auto kTable = [] {
    std::array<std::uint32_t, 256> table{};
    for (std::uint32_t n = 0; n < 256; ++n) {
      std::uint32_t c = n;
      for (int bit = 0; bit < 8; ++bit) c = c & 1 ? 0xedb88320u ^ c >> 1 : c >> 1;
      table[n] = c;
    }
    return table;
  }();
  std::uint32_t crc = 0xffffffffu;
  for (const char byte : bytes) crc = kTable[(crc ^ static_cast<std::uint8_t>(byte)) & 255] ^ crc >> 8;
  return crc ^ 0xffffffffu;
}

std::uint32_t adler_of(std::string_view bytes) {
  std::uint32_t a = 1, b = 0;
  for (const char byte : bytes) {
    a = (a + static_cast<std::uint8_t>(byte)) % 65521;
    b = (b + a) % 65521;
  }
  return b << 16 | a;
}

// Bits from the lowest of each byte up; codes come with their highest bit first.
class Bits {
 public:
  void add(std::uint32_t value, int count) {
    held_ |= static_cast<std::uint64_t>(value) << room_;
    for (room_ += count; room_ >= 8; room_ -= 8, held_ >>= 8) bytes_ += static_cast<char>(held_ & 255);
  }
  void add_code(std::uint32_t code, int count) {
    std::uint32_t turned = 0;
    for (int bit = 0; bit < count; ++bit) turned |= (code >> bit & 1) << (count - 1 - bit);
    add(turned, count);
  }
  std::string finish() {
    if (room_ > 0) add(0, 8 - room_);
    return std::move(bytes_);
  }

 private:
  std::string bytes_;
  std::uint64_t held_ = 0;
  int room_ = 0;
};

// A literal, the end (256) or a length, in the fixed code of RFC 1951, 3.2.6.
void add_symbol(Bits& bits, std::uint32_t symbol) {
  if (symbol < 144)
    bits.add_code(0x30 + symbol, 8);
  else if (symbol < 256)
    bits.add_code(0x190 + symbol - 144, 9);
  else if (symbol < 280)
    bits.add_code(symbol - 256, 7);
  else
    bits.add_code(0xc0 + symbol - 280, 8);
}

constexpr std::size_t kLongestRun = 258, kShortestRun = 3;

// 3 to 258 repeats of the last byte.
void add_run(Bits& bits, std::uint32_t length) {
  if (length == kLongestRun) {
    add_symbol(bits, 285);
  } else if (length < 11) {
    add_symbol(bits, 254 + length);
  } else {
    int extra = 1;  // bits beside the symbol; each count of them serves four symbols
    while ((length - 3) >> (extra + 3) != 0) ++extra;
    add_symbol(bits, 261 + 4 * static_cast<std::uint32_t>(extra) + ((length - 3) >> extra & 3));
    bits.add((length - 3) & ((1u << extra) - 1), extra);
  }
  bits.add_code(0, 5);  // distance 1
}

std::string deflated(std::string_view bytes) {
  Bits bits;
  bits.add(1, 1);  // the last block
  bits.add(1, 2);  // of fixed codes
  for (std::size_t i = 0; i < bytes.size();) {
    std::size_t run = 0;
    while (i > 0 && run < kLongestRun && i + run < bytes.size() && bytes[i + run] == bytes[i - 1]) ++run;
    if (run >= kShortestRun) {
      add_run(bits, static_cast<std::uint32_t>(run));
      i += run;
    } else {
      add_symbol(bits, static_cast<std::uint8_t>(bytes[i++]));
    }
  }
  add_symbol(bits, 256);
  return bits.finish();
}

std::string zlib_of(std::string_view bytes) {
  std::string result("\x78\x01");
  result.append(deflated(bytes));
  append_big_endian(result, adler_of(bytes));
  return result;
}

void append_chunk(std::string& png, std::string_view type, std::string_view data) {
  append_big_endian(png, static_cast<std::uint32_t>(data.size()));
  const std::string body = std::string(type) + std::string(data);
  png += body;
  append_big_endian(png, crc_of(body));
}

}  // namespace

std::string png_of(std::span<const std::uint8_t> pixels, int width, std::span<const Rgb> palette) {
  const std::size_t columns = static_cast<std::size_t>(width), rows = pixels.size() / columns;
  std::string header, colours, lines;
  append_big_endian(header, static_cast<std::uint32_t>(width));
  append_big_endian(header, static_cast<std::uint32_t>(rows));
  header += std::string("\x08\x03\0\0\0", 5);  // 8 bits, of a palette
  for (const Rgb& rgb : palette) colours.append(rgb.begin(), rgb.end());
  lines.reserve(rows * (columns + 1));
  for (std::size_t row = 0; row < rows; ++row) {
    lines += '\0';  // no filter
    lines.append(reinterpret_cast<const char*>(pixels.data()) + row * columns, columns);
  }
  std::string png("\x89PNG\r\n\x1a\n");
  append_chunk(png, "IHDR", header);
  append_chunk(png, "PLTE", colours);
  append_chunk(png, "IDAT", zlib_of(lines));
  append_chunk(png, "IEND", {});
  return png;
}

std::string base64_of(std::string_view bytes) {
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    for (std::size_t j = 0; j < 3; ++j) group = group << 8 | (j < count ? static_cast<std::uint8_t>(bytes[i + j]) : 0u);
    for (std::size_t j = 0; j < 4; ++j) text += j <= count ? kDigits[group >> (18 - 6 * j) & 63] : '=';
  }
  return text;
}

}  // namespace pointfair::cli
