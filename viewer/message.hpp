// SPDX-License-Identifier: Apache-2.0
// The byte layout of what the server sends to the page; web/src/protocol.ts is its reader.
//
// A message is one binary frame: a 32-bit length, that many bytes of JSON, then the arrays that the JSON's "arrays"
// lists as [name, type, count], one after the other. JSON and arrays each end on a multiple of 8 bytes from the start
// (padded with spaces and zeros). Little endian. The page sends JSON text only.
#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace pointfair::viewer {

using Json = nlohmann::ordered_json;
using Bytes = std::vector<std::byte>;

/// A named array of a message; it refers to the caller's numbers.
struct Array {
  std::string_view name, type;
  std::size_t count;
  std::span<const std::byte> bytes;
};

template <class T>
constexpr std::string_view kTypeName = "";
template <>
inline constexpr std::string_view kTypeName<float> = "float32";
template <>
inline constexpr std::string_view kTypeName<std::int16_t> = "int16";
template <>
inline constexpr std::string_view kTypeName<std::uint8_t> = "uint8";
template <>
inline constexpr std::string_view kTypeName<std::uint32_t> = "uint32";

template <class T>
Array make_array(std::string_view name, const std::vector<T>& values) {
  static_assert(!kTypeName<T>.empty());
  return {name, kTypeName<T>, values.size(), std::as_bytes(std::span(values))};
}

/// The message whose JSON is `head` with "arrays" added.
Bytes pack(Json head, const std::vector<Array>& arrays = {});

}  // namespace pointfair::viewer
