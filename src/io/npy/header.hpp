// SPDX-License-Identifier: Apache-2.0
// The header of a NumPy file: a Python dictionary that says type, order and shape of the array.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "io/scalar.hpp"

namespace pointfair::io::npy {

/// One field of a structured type, or the type of plain arrays.
struct Field {
  std::string name;
  std::optional<NativeType> type;  ///< unset: text, complex numbers and others, which are stepped over
  std::size_t size = 0;            ///< bytes of one value
  std::uint64_t count = 1;         ///< values: more than one in a subarray
  bool big_endian = false;
};

struct Header {
  std::vector<Field> fields;  ///< of a structured type, else one without a name
  bool is_structured = false;
  bool fortran_order = false;
  std::vector<std::uint64_t> shape;
  std::size_t end = 0;  ///< where the values begin
};

/// Throws Error(file) for what is no NumPy file, and for types without a size.
Header parse_header(std::string_view bytes, const std::string& name);

/// The header of a new file with so many records of these fields, or rows of so many plain values.
std::string make_header(const std::vector<Field>& fields, std::uint64_t records);
std::string make_header(NativeType type, std::uint64_t rows, std::uint64_t columns);

}  // namespace pointfair::io::npy
