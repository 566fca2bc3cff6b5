// SPDX-License-Identifier: Apache-2.0
#include "io/pcd_header.hpp"

#include <algorithm>
#include <optional>

#include "io/column_names.hpp"
#include "io/coordinate_names.hpp"
#include "io/file_bytes.hpp"
#include "io/no_points.hpp"
#include "io/text.hpp"

namespace pointfair::io {
namespace {

using Words = std::vector<std::string_view>;

constexpr NativeType kTypes[] = {NativeType::int8,    NativeType::uint8,  NativeType::int16, NativeType::uint16,
                                 NativeType::int32,   NativeType::uint32, NativeType::int64, NativeType::uint64,
                                 NativeType::float32, NativeType::float64};

char letter_of(NativeType type) {
  if (!is_integer(type)) return 'F';
  return with_type(type, [](auto tag) { return std::is_signed_v<decltype(tag)> ? 'I' : 'U'; });
}

std::optional<NativeType> type_of(std::string_view letter, std::string_view size) {
  for (const NativeType type : kTypes)
    if (letter == std::string(1, letter_of(type)) && size == std::to_string(size_of(type))) return type;
  return std::nullopt;
}

std::string_view encoding_name(Encoding encoding) {
  if (encoding == Encoding::ascii) return "ascii";
  return encoding == Encoding::binary ? "binary" : "binary_compressed";
}

class HeaderParser {
 public:
  HeaderParser(std::string_view file, const std::string& name)
      : file_(file), rest_(file.substr(byte_order_mark(file))), name_(name) {
    header_.line_end = line_end_of(rest_);
  }

  PcdHeader parse() {
    std::string_view line;
    while (rest_.find(header_.line_end) != std::string_view::npos && next_line(rest_, line, header_.line_end)) {
      ++line_;
      Words words = words_of(line);
      if (words.empty()) continue;
      if (words[0].starts_with('#')) {
        header_.others += words.size() < 2 || words[1] != ".PCD";
        continue;
      }
      const std::string key = upper_case(words[0]);
      const std::size_t end = static_cast<std::size_t>(words.back().data() + words.back().size() - file_.data());
      words.erase(words.begin());
      if (take(key, words, end)) {
        header_.text = file_.substr(0, file_.size() - rest_.size());
        return finish();
      }
    }
    fail(name_, "the header has no 'DATA' line; the file is cut off or not a PCD file");
  }

 private:
  [[noreturn]] void fail_here(const std::string& message) const {
    fail(name_, "line " + std::to_string(line_) + ": " + message);
  }

  std::uint64_t number(const Words& words) const {
    const auto value = words.size() == 1 ? to_count(words[0]) : std::nullopt;
    if (!value) fail_here("expected one whole number");
    return *value;
  }

  // True: that was the last line.
  bool take(std::string_view key, const Words& words, std::size_t end) {
    if (key == "FIELDS" || key == "COLUMNS") {
      names_ = words;
      header_.fields_end = end;
    } else if (key == "SIZE") {
      sizes_ = words;
      header_.sizes_end = end;
    } else if (key == "TYPE") {
      types_ = words;
      header_.types_end = end;
    } else if (key == "COUNT") {
      counts_ = words;
      header_.counts_end = end;
    } else if (key == "WIDTH") {
      width_ = number(words);
    } else if (key == "HEIGHT") {
      height_ = number(words);
    } else if (key == "POINTS") {
      points_ = number(words);
    } else if (key == "VIEWPOINT") {
      header_.viewpoint.clear();
      for (const std::string_view word : words) {
        if (!header_.viewpoint.empty()) header_.viewpoint += ' ';
        header_.viewpoint += word;
      }
    } else if (key == "DATA") {
      return take_encoding(words);
    } else if (key != "VERSION") {
      ++header_.others;  // some programs write lines of their own, as FRAME_ID
    }
    return false;
  }

  bool take_encoding(const Words& words) {
    for (const Encoding encoding : {Encoding::ascii, Encoding::binary, Encoding::binary_compressed}) {
      if (words.size() != 1 || lower_case(words[0]) != encoding_name(encoding)) continue;
      header_.encoding = encoding;
      return true;
    }
    fail_here("unknown DATA; expected ascii, binary or binary_compressed");
  }

  PcdHeader finish() {
    if (names_.empty()) fail(name_, "the header has no FIELDS");
    if (sizes_.size() != names_.size() || types_.size() != names_.size() ||
        (!counts_.empty() && counts_.size() != names_.size())) {
      fail(name_, "FIELDS, SIZE, TYPE and COUNT do not have as many entries; correct the header");
    }
    if (names_.size() > kMaxColumns)
      fail(name_, "has " + std::to_string(names_.size()) + " fields, but at most " + std::to_string(kMaxColumns) +
                      " can be read; leave some out");
    for (std::size_t f = 0; f < names_.size(); ++f) {
      const auto type = type_of(types_[f], sizes_[f]);
      const auto count = counts_.empty() ? std::optional<std::uint64_t>(1) : to_count(counts_[f]);
      if (!type)
        fail(name_, "the field " + quoted(names_[f]) +
                        " has a TYPE and SIZE that PCD does not know; save it as another type, such as F 4");
      if (!count || *count == 0 || *count > 1'000'000)
        fail(name_, "the field " + quoted(names_[f]) + " has no sensible COUNT; correct the header");
      header_.fields.push_back({std::string(names_[f]), *type, static_cast<std::uint32_t>(*count)});
    }
    find_xyz();
    find_points();
    return std::move(header_);
  }

  void find_xyz() {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::string wanted(1, static_cast<char>('x' + axis));
      auto found = std::ranges::find(names_, wanted);
      if (found == names_.end()) found = std::ranges::find(names_, upper_case(wanted));
      if (found == names_.end())
        fail(name_, "there is no field '" + wanted + "', there are " + listed({names_.begin(), names_.end()}) +
                        "; name the coordinates x, y, z");
      header_.xyz[axis] = static_cast<std::size_t>(found - names_.begin());
      if (header_.fields[header_.xyz[axis]].components != 1)
        fail(name_, "the field '" + wanted + "' is a list; a coordinate must be one number");
    }
  }

  void find_points() {
    header_.width = width_.value_or(points_.value_or(0));
    header_.height = height_.value_or(1);
    if (header_.height != 0 && header_.width > UINT64_MAX / header_.height)
      fail(name_, "WIDTH x HEIGHT is too large; correct the header");
    if (points_ && *points_ != header_.points())
      fail(name_, "WIDTH x HEIGHT is " + std::to_string(header_.points()) + " points, POINTS says " +
                      std::to_string(*points_) + "; correct the header");
    if (header_.points() == 0) fail_without_points(name_);
  }

  std::string_view file_, rest_;
  const std::string& name_;
  PcdHeader header_;
  Words names_, sizes_, types_, counts_;
  std::optional<std::uint64_t> width_, height_, points_;
  std::uint64_t line_ = 0;
};

// The attributes as fields: "normal" becomes three, as PCL has it.
std::vector<Column> as_fields(const AddedAttributes& added) {
  std::vector<Column> fields;
  for (const Attribute* attribute : added) {
    const NativeType type = native(attribute->type);
    if (attribute->components == 3 && (attribute->name == "normal" || attribute->name == "normals")) {
      for (const char* name : {"normal_x", "normal_y", "normal_z"}) fields.push_back({name, type, 1});
    } else {
      fields.push_back({attribute->name, type, attribute->components});
    }
  }
  return fields;
}

struct FieldLines {
  std::string names, sizes, types, counts;

  explicit FieldLines(const std::vector<Column>& fields) {
    for (const Column& field : fields) {
      const std::string word = one_word(field.name);
      append(names, word == "_" ? "unnamed" : word);  // a field called so is padding
      append(sizes, std::to_string(size_of(field.type)));
      append(types, std::string(1, letter_of(field.type)));
      append(counts, std::to_string(field.components));
    }
  }
  static void append(std::string& line, const std::string& word) {
    line += ' ';
    line += word;
  }
};

}  // namespace

std::size_t PcdHeader::record_size() const {
  std::size_t size = 0;
  for (const Column& field : fields) size += column_bytes(field);
  return size;
}

PcdHeader parse_pcd_header(std::string_view file, const std::string& name) { return HeaderParser(file, name).parse(); }

std::string pcd_header_text(const PcdHeader& header, const AddedAttributes& added) {
  if (added.empty()) return header.text;
  const FieldLines lines(as_fields(added));
  std::vector<std::pair<std::size_t, std::string>> insertions = {
      {header.fields_end, lines.names}, {header.sizes_end, lines.sizes}, {header.types_end, lines.types}};
  if (header.counts_end != 0) {
    insertions.emplace_back(header.counts_end, lines.counts);
  } else {  // behind whatever was added to TYPE
    insertions.emplace_back(header.types_end, "\nCOUNT" + FieldLines(header.fields).counts + lines.counts);
  }
  std::ranges::stable_sort(insertions, [](auto& a, auto& b) { return a.first < b.first; });
  std::string result;
  PatchedText patched(header.text, result);
  for (const auto& [at, text] : insertions) {
    patched.copy_up_to(header.text.data() + at);
    result += text;
  }
  patched.finish();
  return result;
}

std::string pcd_header_of(std::string_view text, char line_end, std::uint64_t points) {
  std::string result;
  PatchedText patched(text, result);
  for (std::string_view line; next_line(text, line, line_end);) {
    const Words words = words_of(line);
    if (words.size() < 2) continue;
    const std::string key = upper_case(words[0]);
    if (key == "WIDTH" || key == "POINTS") patched.replace(words[1], std::to_string(points));
    if (key == "HEIGHT") patched.replace(words[1], "1");
  }
  patched.finish();
  return result;
}

std::string new_pcd_header(const std::vector<Column>& fields, std::uint64_t width, std::uint64_t height,
                           const std::string& viewpoint, Encoding encoding) {
  const FieldLines lines(fields);
  return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS" + lines.names + "\nSIZE" + lines.sizes +
         "\nTYPE" + lines.types + "\nCOUNT" + lines.counts + "\nWIDTH " + std::to_string(width) + "\nHEIGHT " +
         std::to_string(height) + "\nVIEWPOINT " + viewpoint + "\nPOINTS " + std::to_string(width * height) +
         "\nDATA " + std::string(encoding_name(encoding)) + "\n";
}

}  // namespace pointfair::io
