// SPDX-License-Identifier: Apache-2.0
// The attributes in a point record: which bits of which bytes they are, and what they are called.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "io/las/header.hpp"
#include "io/source.hpp"

namespace pointfair::io::las {

struct Field : Column {
  std::size_t offset = 0;                       ///< of the field in the record
  NativeType stored{};                          ///< its type there; `type` is what is shown
  unsigned shift = 0;                           ///< of a part of a byte, which has `bits`
  std::array<double, 3> scale{1, 1, 1}, add{};  ///< of a component, where `scaled`

  ByteRange bytes() const { return {offset, offset + components * size_of(stored)}; }  ///< of the record
};

/// The fields of the file's records in their order, coordinates excluded, extra bytes included.
std::vector<Field> record_fields(const Header& header);

/// The values of `field` in `count` records that follow each other.
void extract_field(const Field& field, const char* records, std::size_t record_length, std::size_t count, char* to);

/// What the components of added columns are called: as no other field is, in at most kLongestLasName bytes.
std::vector<std::string> extra_names(const Header& header, const std::vector<Column>& added);

/// The descriptions of extra bytes as a file with these attributes added has them: those of the file, where bytes have
/// none a plain one, then one for each component added, with its extra_names().
std::string describe_extra_bytes(const Header& header, const std::vector<Column>& added);

}  // namespace pointfair::io::las
