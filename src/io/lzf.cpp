// SPDX-License-Identifier: Apache-2.0
#include "io/lzf.hpp"

#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

namespace pointfair::io {
namespace {

constexpr std::size_t kMaxLiterals = 32, kMaxDistance = 8192, kMaxLength = 264, kMinLength = 3;
constexpr unsigned kHashBits = 14;

std::uint32_t three_bytes(const char* at) {
  std::uint32_t value = 0;
  std::memcpy(&value, at, 3);
  return value;
}

std::size_t hash(std::uint32_t value) { return (value * 2654435761U) >> (32 - kHashBits); }

void put_literals(std::string_view literals, std::string& to) {
  for (; !literals.empty(); literals.remove_prefix(std::min(literals.size(), kMaxLiterals))) {
    const std::string_view run = literals.substr(0, kMaxLiterals);
    to += static_cast<char>(run.size() - 1);
    to += run;
  }
}

void put_match(std::size_t distance, std::size_t length, std::string& to) {
  const std::size_t code = length - 2, back = distance - 1;
  to += static_cast<char>(std::min<std::size_t>(code, 7) << 5 | back >> 8);
  if (code >= 7) to += static_cast<char>(code - 7);
  to += static_cast<char>(back & 255);
}

}  // namespace

bool lzf_decompress(std::string_view from, char* to, std::size_t size) {
  std::size_t in = 0, out = 0;
  const auto byte = [&] { return static_cast<std::size_t>(static_cast<unsigned char>(from[in++])); };
  while (in < from.size()) {
    const std::size_t control = byte();
    if (control < kMaxLiterals) {
      const std::size_t count = control + 1;
      if (count > from.size() - in || count > size - out) return false;
      std::memcpy(to + out, from.data() + in, count);
      in += count;
      out += count;
      continue;
    }
    std::size_t length = control >> 5;
    if (from.size() - in < (length == 7 ? 2U : 1U)) return false;
    if (length == 7) length += byte();
    length += 2;
    const std::size_t distance = ((control & 31) << 8 | byte()) + 1;
    if (distance > out || length > size - out) return false;
    // Byte by byte: source and target may overlap, and then the copied bytes repeat.
    for (const std::size_t end = out + length; out < end; ++out) to[out] = to[out - distance];
  }
  return out == size;
}

void lzf_compress(std::string_view from, std::string& to) {
  std::vector<std::size_t> seen(std::size_t{1} << kHashBits, from.size());  // last place of a hash; size: none
  std::size_t at = 0, literals_begin = 0;
  while (at + kMinLength <= from.size()) {
    const std::uint32_t value = three_bytes(from.data() + at);
    const std::size_t before = std::exchange(seen[hash(value)], at);
    if (before >= at || at - before > kMaxDistance || three_bytes(from.data() + before) != value) {
      ++at;
      continue;
    }
    const std::size_t longest = std::min(kMaxLength, from.size() - at);
    std::size_t length = kMinLength;
    while (length < longest && from[before + length] == from[at + length]) ++length;
    put_literals(from.substr(literals_begin, at - literals_begin), to);
    put_match(at - before, length, to);
    at += length;
    literals_begin = at;
  }
  put_literals(from.substr(literals_begin), to);
}

}  // namespace pointfair::io
