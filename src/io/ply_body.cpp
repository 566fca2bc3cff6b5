// SPDX-License-Identifier: Apache-2.0
#include "io/ply_body.hpp"

#include "io/file_bytes.hpp"
#include "io/text.hpp"

namespace pointfair::io {

void PlyCursor::begin_row() {
  if (encoding_ != Encoding::ascii) return;
  if (wrapped_) {
    if (line_.data() == nullptr) line_ = file_.substr(at_);
    return;
  }
  std::string_view rest = file_.substr(at_);
  std::string_view word, peek;
  do {
    if (!next_line(rest, line_, line_end_)) fail(name_, "the file ends inside its data; it is cut off");
    peek = line_;
  } while (!next_word(peek, word));
  at_ = file_.size() - rest.size();
}

void PlyCursor::need(std::size_t size) const {
  if (file_.size() - at_ < size) fail(name_, "the file ends inside its data; it is cut off");
}

// Of a text.
std::string_view PlyCursor::word() {
  std::string_view word;
  const char* const place = line_.data();
  if (next_word(line_, word) && to_number(word)) return word;
  const std::string line = "line " + std::to_string(line_number(file_, place)) + ": ";
  fail(name_, line + (word.empty() ? "too few values" : quoted(word) + " is not a number") + "; repair the line");
}

void PlyCursor::next_integer(NativeType type, char* to) {
  if (encoding_ == Encoding::ascii) {
    const std::string_view digits = word();
    if (!to_integer(digits, type, to)) store_double(to, type, false, to_number(digits).value());
    return;
  }
  need(size_of(type));
  copy_scalar(to, file_.data() + at_, size_of(type), must_swap(encoding_));
  at_ += size_of(type);
}

double PlyCursor::next(NativeType type) {
  if (encoding_ == Encoding::ascii) return to_number(word()).value();
  need(size_of(type));
  const double value = load_double(file_.data() + at_, type, must_swap(encoding_));
  at_ += size_of(type);
  return value;
}

std::uint64_t PlyCursor::next_list_size(const PlyProperty& property) {
  const double size = next(*property.list_count);
  const std::size_t left = encoding_ == Encoding::ascii ? line_.size() : (file_.size() - at_) / size_of(property.type);
  if (!(size >= 0 && size <= static_cast<double>(left)))
    fail(name_, "the list '" + property.name + "' is longer than the file; it is cut off or damaged");
  return static_cast<std::uint64_t>(size);
}

void PlyCursor::skip(const PlyProperty& property) {
  std::uint64_t count = property.list_count ? next_list_size(property) : 1;
  if (encoding_ == Encoding::ascii) {
    for (; count > 0; --count) next(property.type);
    return;
  }
  need(static_cast<std::size_t>(count) * size_of(property.type));
  at_ += static_cast<std::size_t>(count) * size_of(property.type);
}

void PlyEmitter::put(double value, NativeType type) {
  char stored[8];
  store_double(stored, type, false, value);
  put_scalar(stored, type);
}

void PlyEmitter::put_scalar(const char* value, NativeType type) {
  if (encoding_ == Encoding::ascii) {
    if (!first_in_row_) to_ += ' ';
    first_in_row_ = false;
    append_scalar(to_, value, type);
    return;
  }
  char bytes[8];
  copy_scalar(bytes, value, size_of(type), must_swap(encoding_));
  to_.append(bytes, size_of(type));
}

void PlyEmitter::end_row() {
  if (encoding_ != Encoding::ascii) return;
  to_ += line_end_;
  first_in_row_ = true;
}

}  // namespace pointfair::io
