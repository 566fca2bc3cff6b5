// SPDX-License-Identifier: Apache-2.0
#include "io/ply_header.hpp"

#include <algorithm>
#include <array>

#include "io/column_names.hpp"
#include "io/file_bytes.hpp"
#include "io/text.hpp"

namespace pointfair::io {
namespace {

constexpr std::array<std::string_view, 8> kTypeNames = {"char", "uchar", "short", "ushort",
                                                        "int",  "uint",  "float", "double"};
constexpr std::array<std::string_view, 8> kSizedNames = {"int8",  "uint8",  "int16",   "uint16",
                                                         "int32", "uint32", "float32", "float64"};

std::optional<NativeType> type_named(std::string_view name) {
  for (std::size_t i = 0; i < kTypeNames.size(); ++i)
    if (name == kTypeNames[i] || name == kSizedNames[i]) return static_cast<NativeType>(i);
  if (name == "bool") return NativeType::uint8;  // as several libraries of today write it
  if (name == "int64" || name == "long") return NativeType::int64;
  if (name == "uint64" || name == "ulong") return NativeType::uint64;
  return std::nullopt;
}

class HeaderParser {
 public:
  HeaderParser(std::string_view file, const std::string& name)
      : file_(file), rest_(file.substr(byte_order_mark(file))), name_(name) {
    header_.line_end = line_end_of(rest_);
  }

  PlyHeader parse() {
    std::string_view line;
    if (!take(line) || words_of(line) != std::vector<std::string_view>{"ply"})
      fail(name_, "does not begin with 'ply'; is it another format?");
    bool format_seen = false;
    while (take(line)) {
      const auto words = words_of(line);
      if (words.empty()) continue;
      if (words[0] == "comment" || words[0] == "obj_info") {
        comment(words);
        continue;
      }
      if (words[0] == "end_header") return finish(format_seen);
      if (words[0] == "format" && !format_seen) {
        format(words);
        format_seen = true;
      } else if (words[0] == "element") {
        element(words);
      } else if (words[0] == "property") {
        property(words);
      } else {
        fail_here("unexpected " + quoted(words[0]) + " in the header");
      }
    }
    fail(name_, "the header has no 'end_header'; the file is cut off or damaged");
  }

 private:
  bool take(std::string_view& line) {
    if (rest_.find(header_.line_end) == std::string_view::npos) return false;
    ++line_;
    return next_line(rest_, line, header_.line_end);
  }

  [[noreturn]] void fail_here(const std::string& message) const {
    fail(name_, "line " + std::to_string(line_) + ": " + message);
  }

  std::size_t position() const { return file_.size() - rest_.size(); }

  void comment(const std::vector<std::string_view>& words) {
    if (words.size() == 1) return;
    if (words.size() > 2 && words[1] == "TextureFile") {
      header_.textures.emplace_back(words[2].data(), words.back().data() + words.back().size());  // may have blanks
    } else {
      ++header_.comments;
    }
  }

  void format(const std::vector<std::string_view>& words) {
    for (const Encoding encoding : {Encoding::ascii, Encoding::binary, Encoding::binary_big_endian}) {
      if (words.size() != 3 || words[1] != ply_encoding_name(encoding)) continue;
      header_.encoding = encoding;
      header_.encoding_at = static_cast<std::size_t>(words[1].data() - file_.data());
      return;
    }
    fail_here("unknown format; expected ascii, binary_little_endian or binary_big_endian 1.0");
  }

  void element(const std::vector<std::string_view>& words) {
    const auto count = words.size() == 3 ? to_count(words[2]) : std::nullopt;
    if (!count) fail_here("expected 'element NAME COUNT'");
    header_.elements.push_back({std::string(words[1]), *count, {}});
    if (words[1] == "vertex") header_.properties_end = position();
  }

  void property(const std::vector<std::string_view>& words) {
    if (header_.elements.empty()) fail_here("a property before the first element");
    PlyElement& element = header_.elements.back();
    const bool list = words.size() == 5 && words[1] == "list";
    const auto type = words.size() >= 3 ? type_named(words[words.size() - 2]) : std::nullopt;
    const auto count_type = list ? type_named(words[2]) : std::nullopt;
    if (!type || (words.size() != 3 && !count_type) || (count_type && !is_integer(*count_type))) {
      const bool shaped = words.size() == 3 || list;
      fail_here("expected 'property TYPE NAME' or 'property list TYPE TYPE NAME' with the types of PLY" +
                (shaped && !type ? ", not " + quoted(words[words.size() - 2]) : std::string()));
    }
    element.properties.push_back({std::string(words.back()), *type, count_type});
    if (element.name == "vertex") header_.properties_end = position();
  }

  PlyHeader finish(bool format_seen) {
    if (!format_seen) fail(name_, "the header has no 'format' line");
    const auto is_vertex = [](const PlyElement& e) { return e.name == "vertex"; };
    const auto vertex = std::ranges::find_if(header_.elements, is_vertex);
    if (vertex == header_.elements.end()) fail(name_, "the header has no element 'vertex', so no points");
    if (std::any_of(vertex + 1, header_.elements.end(), is_vertex))
      fail(name_, "the header has two elements 'vertex'; split the file");
    if (vertex->properties.size() > kMaxColumns)
      fail(name_, "a vertex has " + std::to_string(vertex->properties.size()) + " properties, but at most " +
                      std::to_string(kMaxColumns) + " can be read; leave some out");
    for (const PlyElement& element : header_.elements) {  // its rows would be nothing, and any number of them
      if (element.count == 0 || !element.properties.empty()) continue;
      fail(name_, "the element '" + element.name + "' has no properties; remove it from the header");
    }
    header_.vertex = static_cast<std::size_t>(vertex - header_.elements.begin());
    header_.text = file_.substr(0, position());
    return std::move(header_);
  }

  std::string_view file_, rest_;
  const std::string& name_;
  PlyHeader header_;
  std::uint64_t line_ = 0;
};

}  // namespace

PlyHeader parse_ply_header(std::string_view file, const std::string& name) { return HeaderParser(file, name).parse(); }

std::string_view ply_encoding_name(Encoding encoding) {
  if (encoding == Encoding::ascii) return "ascii";
  return encoding == Encoding::binary ? "binary_little_endian" : "binary_big_endian";
}

std::string ply_property_lines(const std::vector<AttributeInfo>& attributes, std::string_view line_end) {
  std::string lines;
  for (const AttributeInfo& attribute : attributes) {
    for (const std::string& name : component_names(attribute.name, attribute.components)) {
      lines += "property ";
      lines += kTypeNames[static_cast<std::size_t>(attribute.type)];
      lines += ' ';
      lines += one_word(name);
      lines += line_end;
    }
  }
  return lines;
}

std::string ply_header_text(const PlyHeader& header, Encoding encoding, const AddedAttributes& added) {
  const std::string_view text = header.text;
  const std::string_view line_end = text.ends_with("\r\n") ? "\r\n" : text.ends_with('\r') ? "\r" : "\n";
  std::string result;
  PatchedText patched(text, result);
  const std::size_t length = ply_encoding_name(header.encoding).size();
  patched.replace(text.substr(header.encoding_at, length), ply_encoding_name(encoding));
  patched.copy_up_to(text.data() + header.properties_end);
  for (const Attribute* attribute : added) result += ply_property_lines({*attribute}, line_end);
  patched.finish();
  return result;
}

std::string ply_header_with(const std::vector<std::uint64_t>& counts, std::string_view text, const PlyHeader& header) {
  std::string result;
  PatchedText patched(text, result);
  auto count = counts.begin();
  for (std::string_view line; next_line(text, line, header.line_end);) {
    const std::vector<std::string_view> words = words_of(line);
    if (words.size() == 3 && words[0] == "element") patched.replace(words[2], std::to_string(*count++));
  }
  patched.finish();
  return result;
}

std::size_t find_property(const PlyElement& element, std::string_view name) {
  const auto begin = element.properties.begin(), end = element.properties.end();
  auto found = std::find_if(begin, end, [&](const PlyProperty& p) { return p.name == name; });
  if (found == end) found = std::find_if(begin, end, [&](const PlyProperty& p) { return lower_case(p.name) == name; });
  return static_cast<std::size_t>(found - element.properties.begin());
}

std::optional<std::size_t> record_size(const PlyElement& element) {
  std::size_t size = 0;
  for (const PlyProperty& property : element.properties) {
    if (property.list_count) return std::nullopt;
    size += size_of(property.type);
  }
  return size;
}

}  // namespace pointfair::io
