// SPDX-License-Identifier: Apache-2.0
// The values of a PLY file one after the other, in any of the three encodings. Every PLY type fits a double.
#pragma once

#include <string>
#include <string_view>

#include "io/ply_header.hpp"

namespace pointfair::io {

/// Reads rows. Throws Error(file) at the end of the bytes or at a word that is no number.
class PlyCursor {
 public:
  PlyCursor(std::string_view file, std::size_t at, Encoding encoding, const std::string& name)
      : file_(file), at_(at), encoding_(encoding), name_(name) {}

  void begin_row();
  double next(NativeType type);
  std::uint64_t next_list_size(const PlyProperty& property);
  /// Steps over the values of one property.
  void skip(const PlyProperty& property);
  std::size_t position() const { return at_; }

 private:
  void need(std::size_t size) const;

  std::string_view file_;
  std::size_t at_;
  Encoding encoding_;
  const std::string& name_;
  std::string_view line_;
};

/// Appends rows to a buffer.
class PlyEmitter {
 public:
  PlyEmitter(std::string& to, Encoding encoding) : to_(to), encoding_(encoding) {}

  void put(double value, NativeType type);
  void end_row();

 private:
  std::string& to_;
  Encoding encoding_;
  bool first_in_row_ = true;
};

constexpr bool must_swap(Encoding encoding) {
  return encoding == Encoding::binary_big_endian ? std::endian::native != std::endian::big
                                                 : std::endian::native == std::endian::big;
}

}  // namespace pointfair::io
