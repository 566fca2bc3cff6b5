// SPDX-License-Identifier: Apache-2.0
// Values in the records of LAS points, which are little endian.
#pragma once

#include <bit>
#include <cstddef>

#include "io/scalar.hpp"

namespace pointfair::io::las {

/// Bytes of a record, from `begin` up to `end`.
struct ByteRange {
  std::size_t begin = 0, end = 0;

  bool meets(const ByteRange& other) const { return begin < other.end && other.begin < end; }
};

template <class T>
T load_little(const char* from) {
  return load<T>(from, std::endian::native == std::endian::big);
}

template <class T>
void store_little(char* to, T value) {
  copy_scalar(to, reinterpret_cast<const char*>(&value), sizeof value, std::endian::native == std::endian::big);
}

}  // namespace pointfair::io::las
