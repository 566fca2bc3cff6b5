// SPDX-License-Identifier: Apache-2.0
// Numbers as files store them: one of ten types, in either byte order, at any alignment.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <type_traits>

#include "pointfair/cloud.hpp"

namespace pointfair::io {

inline constexpr std::size_t kMaxColumns = 4096;      ///< of a record; a file with more is damaged
inline constexpr std::size_t kMaxTextColumns = 1024;  ///< of a row of text, where each is looked for from the left

/// The types of `ScalarType`, in its order, and the 64-bit integers that only PCD files know.
enum class NativeType : std::uint8_t { int8, uint8, int16, uint16, int32, uint32, float32, float64, int64, uint64 };

constexpr NativeType native(ScalarType type) { return static_cast<NativeType>(type); }

/// The type under which a column is shown: 64-bit integers become doubles.
constexpr ScalarType shown_as(NativeType type) {
  return type > NativeType::float64 ? ScalarType::float64 : static_cast<ScalarType>(type);
}

constexpr bool is_integer(NativeType type) { return type != NativeType::float32 && type != NativeType::float64; }

/// Calls `f` with a value of the C++ type that `type` names, and returns what `f` returns.
template <class F>
decltype(auto) with_type(NativeType type, F&& f) {
  switch (type) {
    case NativeType::int8:
      return f(std::int8_t{});
    case NativeType::uint8:
      return f(std::uint8_t{});
    case NativeType::int16:
      return f(std::int16_t{});
    case NativeType::uint16:
      return f(std::uint16_t{});
    case NativeType::int32:
      return f(std::int32_t{});
    case NativeType::uint32:
      return f(std::uint32_t{});
    case NativeType::float32:
      return f(float{});
    case NativeType::int64:
      return f(std::int64_t{});
    case NativeType::uint64:
      return f(std::uint64_t{});
    case NativeType::float64:
      break;
  }
  return f(double{});
}

constexpr std::size_t size_of(NativeType type) {
  constexpr std::size_t kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8, 8, 8};
  return kSizes[static_cast<std::size_t>(type)];
}

/// Copies the `size` bytes of one scalar, turning them round if `swap`.
inline void copy_scalar(char* to, const char* from, std::size_t size, bool swap) {
  if (swap) {
    std::reverse_copy(from, from + size, to);
  } else {
    std::memcpy(to, from, size);
  }
}

template <class T>
T load(const char* from, bool swap) {
  T value;
  copy_scalar(reinterpret_cast<char*>(&value), from, sizeof(T), swap);
  return value;
}

/// Whether this machine is, so that values of little endian files are turned round.
inline constexpr bool kBigEndian = std::endian::native == std::endian::big;

template <class T>
T load_little(const char* from) {
  return load<T>(from, kBigEndian);
}
template <class T>
void store_little(char* to, T value) {
  copy_scalar(to, reinterpret_cast<const char*>(&value), sizeof value, kBigEndian);
}
template <class T>
void append_little(std::string& to, T value) {
  to.resize(to.size() + sizeof value);
  store_little(to.data() + to.size() - sizeof value, value);
}

/// `value` as a T: rounded and clamped to an integer type's range, NaN as 0.
template <class T>
T narrow(double value) {
  if constexpr (std::is_integral_v<T>) {
    if (std::isnan(value)) return 0;
    const double rounded = std::nearbyint(value);
    if (rounded <= static_cast<double>(std::numeric_limits<T>::min())) return std::numeric_limits<T>::min();
    if (rounded >= static_cast<double>(std::numeric_limits<T>::max())) return std::numeric_limits<T>::max();
    return static_cast<T>(rounded);
  } else {
    return static_cast<T>(value);
  }
}

inline double load_double(const char* from, NativeType type, bool swap) {
  return with_type(type, [&](auto tag) { return static_cast<double>(load<decltype(tag)>(from, swap)); });
}

inline void store_double(char* to, NativeType type, bool swap, double value) {
  with_type(type, [&](auto tag) {
    const auto stored = narrow<decltype(tag)>(value);
    copy_scalar(to, reinterpret_cast<const char*>(&stored), sizeof stored, swap);
  });
}

}  // namespace pointfair::io
