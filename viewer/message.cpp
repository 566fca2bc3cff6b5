// SPDX-License-Identifier: Apache-2.0
#include "message.hpp"

#include <bit>
#include <cstring>

namespace pointfair::viewer {
namespace {

static_assert(std::endian::native == std::endian::little, "the layout is little endian");
constexpr std::size_t kAlignment = 8;
constexpr std::size_t kLengthBytes = sizeof(std::uint32_t);

std::size_t aligned(std::size_t bytes) { return (bytes + kAlignment - 1) / kAlignment * kAlignment; }

}  // namespace

Bytes pack(Json head, const std::vector<Array>& arrays) {
  Json list = Json::array();
  std::size_t array_bytes = 0;
  for (const Array& array : arrays) {
    list.push_back({array.name, array.type, array.count});
    array_bytes += aligned(array.bytes.size());
  }
  head["arrays"] = list;
  std::string text = head.dump(-1, ' ', false, Json::error_handler_t::replace);
  text.resize(aligned(kLengthBytes + text.size()) - kLengthBytes, ' ');
  Bytes message(kLengthBytes + text.size() + array_bytes);
  const auto length = static_cast<std::uint32_t>(text.size());
  std::byte* out = message.data();
  std::memcpy(out, &length, kLengthBytes);
  std::memcpy(out + kLengthBytes, text.data(), text.size());
  out += kLengthBytes + text.size();
  for (const Array& array : arrays) {
    if (!array.bytes.empty()) std::memcpy(out, array.bytes.data(), array.bytes.size());
    out += aligned(array.bytes.size());
  }
  return message;
}

}  // namespace pointfair::viewer
