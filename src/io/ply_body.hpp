// SPDX-License-Identifier: Apache-2.0
// The values of a PLY file one after the other, in any of the three encodings. Every type of PLY fits a double; the
// 64-bit integers that some write do not.
#pragma once

#include <string>
#include <string_view>

#include "io/ply_header.hpp"

namespace pointfair::io {

/// Reads rows. Throws Error(file) at the end of the bytes or at a word that is no number.
class PlyCursor {
 public:
  /// `wrapped`: the rows of a text do not keep to lines.
  PlyCursor(std::string_view file, std::size_t at, const PlyHeader& header, bool wrapped, const std::string& name)
      : file_(file), at_(at), encoding_(header.encoding), line_end_(header.line_end), wrapped_(wrapped), name_(name) {}

  void begin_row();
  double next(NativeType type);
  /// The same for a 64-bit integer, with all its digits.
  void next_integer(NativeType type, char* to);
  std::uint64_t next_list_size(const PlyProperty& property);
  /// Steps over the values of one property.
  void skip(const PlyProperty& property);
  std::size_t position() const { return wrapped_ ? file_.size() - line_.size() : at_; }

 private:
  void need(std::size_t size) const;
  std::string_view word();

  std::string_view file_;
  std::size_t at_;
  Encoding encoding_;
  char line_end_;
  bool wrapped_;
  const std::string& name_;
  std::string_view line_;  ///< what is left of the row; of the file where rows are wrapped
};

/// Appends rows to a buffer.
class PlyEmitter {
 public:
  PlyEmitter(std::string& to, Encoding encoding, char line_end = '\n')
      : to_(to), encoding_(encoding), line_end_(line_end) {}

  void put(double value, NativeType type);
  /// A value as memory holds it.
  void put_scalar(const char* value, NativeType type);
  void end_row();

 private:
  std::string& to_;
  Encoding encoding_;
  char line_end_;
  bool first_in_row_ = true;
};

constexpr bool must_swap(Encoding encoding) { return (encoding == Encoding::binary_big_endian) != kBigEndian; }

}  // namespace pointfair::io
