// SPDX-License-Identifier: Apache-2.0
// The format is that of numpy.lib.format, versions 1.0 to 3.0.
#include "io/npy/header.hpp"

#include <utility>

#include "io/file_bytes.hpp"
#include "io/text.hpp"

namespace pointfair::io::npy {
namespace {

constexpr std::string_view kMagic("\x93NUMPY", 6);
constexpr std::uint64_t kMostValues = std::uint64_t{1} << 40;  // of a shape, so that products do not overflow

constexpr std::string_view kBool = "b1";
constexpr std::pair<std::string_view, NativeType> kTypes[] = {
    {kBool, NativeType::uint8},  {"i1", NativeType::int8},  {"u1", NativeType::uint8},  {"i2", NativeType::int16},
    {"u2", NativeType::uint16},  {"i4", NativeType::int32}, {"u4", NativeType::uint32}, {"f4", NativeType::float32},
    {"f8", NativeType::float64}, {"i8", NativeType::int64}, {"u8", NativeType::uint64}};

// Reads the Python literals that such a header consists of.
class Literals {
 public:
  Literals(std::string_view text, const std::string& name) : rest_(text), name_(name) {}

  Header header() {
    Header header;
    bool has_type = false, has_shape = false;
    expect('{');
    while (!take('}')) {
      const std::string key = string();
      expect(':');
      if (key == "descr") {
        read_type(header);
        has_type = true;
      } else if (key == "fortran_order") {
        header.fortran_order = boolean();
      } else if (key == "shape") {
        header.shape = shape();
        has_shape = true;
      } else {
        damaged("an unknown key " + io::quoted(key));
      }
      if (!take(',')) {
        expect('}');
        break;
      }
    }
    if (!has_type || !has_shape) damaged("no type or no shape");
    return header;
  }

 private:
  [[noreturn]] void damaged(const std::string& what) const {
    fail(name_, "the header of this NumPy file has " + what + "; write the array again with numpy.save");
  }
  void skip_blanks() {
    while (!rest_.empty() && (is_blank(rest_[0]) || rest_[0] == '\n')) rest_.remove_prefix(1);
  }
  bool take(char c) {
    skip_blanks();
    if (rest_.empty() || rest_[0] != c) return false;
    rest_.remove_prefix(1);
    return true;
  }
  void expect(char c) {
    if (!take(c)) damaged("no '" + std::string(1, c) + "' where one belongs");
  }
  std::string string() {
    skip_blanks();
    const char quote = rest_.empty() ? ' ' : rest_[0];
    if (quote != '\'' && quote != '"') damaged("no text where some belongs");
    const std::size_t end = rest_.find(quote, 1);
    if (end == std::string_view::npos) damaged("a text that does not end");
    std::string result(rest_.substr(1, end - 1));
    rest_.remove_prefix(end + 1);
    return result;
  }
  bool boolean() {
    skip_blanks();
    for (const auto& [word, value] : {std::pair<std::string_view, bool>{"True", true}, {"False", false}}) {
      if (!rest_.starts_with(word)) continue;
      rest_.remove_prefix(word.size());
      return value;
    }
    damaged("neither True nor False for its order");
  }
  std::uint64_t number() {
    skip_blanks();
    const std::size_t end = rest_.find_first_not_of("0123456789");
    const std::optional<std::uint64_t> value = to_count(rest_.substr(0, end));
    if (!value || *value > kMostValues) damaged("a number that is none, or too large");
    rest_.remove_prefix(end == std::string_view::npos ? rest_.size() : end);
    take('L');  // of Python 2
    return *value;
  }
  std::vector<std::uint64_t> shape() {
    std::vector<std::uint64_t> result;
    expect('(');
    while (!take(')')) {
      if (result.size() == 8) damaged("more than 8 dimensions");
      result.push_back(number());
      if (!take(',')) {
        expect(')');
        break;
      }
    }
    return result;
  }

  void read_type(Header& header) {
    header.is_structured = take('[');
    if (!header.is_structured) {
      header.fields = {field(string())};
      return;
    }
    while (!take(']')) {
      if (header.fields.size() == kMaxColumns) damaged("too many fields");
      header.fields.push_back(structured_field());
      if (!take(',')) {
        expect(']');
        break;
      }
    }
  }
  // ('name', '<f4') or ('name', '<f4', (3,)); the name may have a title before it.
  Field structured_field() {
    expect('(');
    std::string field_name;
    if (take('(')) {
      string();
      expect(',');
      field_name = string();
      expect(')');
    } else {
      field_name = string();
    }
    expect(',');
    skip_blanks();
    if (rest_.starts_with('[')) damaged("a type within a type; save its fields side by side");
    Field result = field(string());
    result.name = field_name;
    if (take(',')) {
      skip_blanks();
      if (rest_.starts_with('(')) {
        for (const std::uint64_t length : shape()) {
          result.count *= length;
          if (result.count > kMaxColumns) damaged("a field of too many values");
        }
      }
    }
    expect(')');
    return result;
  }
  Field field(std::string_view type) const {
    Field result;
    const char order = type.empty() ? ' ' : type[0];
    result.big_endian = order == '>';
    if (order == '=') result.big_endian = kBigEndian;
    const std::string_view plain = type.substr(order == '<' || order == '>' || order == '|' || order == '=' ? 1 : 0);
    for (const auto& [known, native] : kTypes) {
      if (plain != known) continue;
      result.type = native;
      result.size = size_of(native);
      return result;
    }
    // Text, raw bytes, times, complex numbers and halves have their size behind the letter, text in letters of 4 bytes.
    const std::optional<std::uint64_t> size =
        plain.empty() ? std::nullopt : to_count(plain.substr(1, plain.find('[') - 1));
    const bool has_size = !plain.empty() && std::string_view("SaUVmMcf").find(plain[0]) != std::string_view::npos;
    if (!has_size || !size || *size > 65536) damaged("the type " + io::quoted(type) + ", which cannot be read");
    result.size = static_cast<std::size_t>(*size) * (plain[0] == 'U' ? 4 : 1);
    return result;
  }

  std::string_view rest_;
  const std::string& name_;
};

std::string type_text(const Field& field) {
  const auto& [word, type] =
      *std::ranges::find_if(kTypes, [&](const auto& row) { return row.second == field.type && row.first != kBool; });
  const std::string order = size_of(type) == 1 ? "|" : field.big_endian ? ">" : "<";
  return "'" + order + std::string(word) + "'";
}

// Text with letters beyond ASCII. Names of other files may be Latin-1.
bool is_utf8(std::string_view text) {
  const auto byte = [&](std::size_t at) { return at < text.size() ? static_cast<unsigned char>(text[at]) : 0U; };
  bool is_beyond = false;
  for (std::size_t at = 0; at < text.size(); ++at) {
    if (byte(at) < 0x80) continue;
    is_beyond = true;
    const int more = byte(at) >= 0xF0 ? 3 : byte(at) >= 0xE0 ? 2 : 1;
    if (byte(at) < 0xC2 || byte(at) > 0xF4) return false;
    for (int i = 0; i < more; ++i)
      if ((byte(++at) & 0xC0) != 0x80) return false;
  }
  return is_beyond;
}

std::string from_latin1(std::string_view text) {
  std::string result;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x80) {
      result += c;
    } else {
      result += static_cast<char>(0xC0 | byte >> 6);
      result += static_cast<char>(0x80 | (byte & 0x3F));
    }
  }
  return result;
}

// Padded so that the values begin at a multiple of 64 bytes. Headers of version 3 are UTF-8, those before it Latin-1.
std::string framed(std::string text) {
  const bool has_letters = is_utf8(text);
  const bool is_long = text.size() > 65000 || has_letters;
  const std::size_t front = kMagic.size() + 2 + (is_long ? 4 : 2);
  text.append(63 - (front + text.size()) % 64, ' ');
  text += '\n';
  std::string result(kMagic);
  result += has_letters ? '\3' : is_long ? '\2' : '\1';
  result += '\0';
  for (std::size_t byte = 0; byte < (is_long ? 4U : 2U); ++byte)
    result += static_cast<char>(text.size() >> 8 * byte & 255);
  return result + text;
}

}  // namespace

Header parse_header(std::string_view bytes, const std::string& name) {
  const auto cut_off = [&]() { fail(name, "ends within the header of a NumPy file; copy the file again"); };
  if (!bytes.starts_with(kMagic)) fail(name, "does not begin as a NumPy file does; is it another format?");
  if (bytes.size() < 12) cut_off();
  const auto byte = [&](std::size_t at) { return static_cast<std::size_t>(static_cast<unsigned char>(bytes[at])); };
  const std::size_t version = byte(6);
  if (version < 1 || version > 3)
    fail(name, "is a NumPy file of version " + std::to_string(version) + ", which is not known; save it anew");
  std::size_t begin = 10, length = byte(8) | byte(9) << 8;
  if (version > 1) {
    length |= byte(10) << 16 | byte(11) << 24;
    begin = 12;
  }
  if (bytes.size() - begin < length) cut_off();
  std::string text(bytes.substr(begin, length));
  if (version < 3) text = from_latin1(text);
  Header header = Literals(text, name).header();
  header.end = begin + length;
  return header;
}

std::string make_header(const std::vector<Field>& fields, std::uint64_t records) {
  std::string text = "{'descr': [";
  for (const Field& field : fields) {
    std::string plain = field.name;
    for (char& c : plain)
      if (c == '\'' || c == '\\') c = '_';
    text += (text.back() == '[' ? "('" : ", ('") + plain + "', " + type_text(field);
    if (field.count > 1) text += ", (" + std::to_string(field.count) + ",)";
    text += ")";
  }
  return framed(text + "], 'fortran_order': False, 'shape': (" + std::to_string(records) + ",), }");
}

std::string make_header(NativeType type, std::uint64_t rows, std::uint64_t columns) {
  Field field;
  field.type = type;
  field.big_endian = kBigEndian;
  return framed("{'descr': " + type_text(field) + ", 'fortran_order': False, 'shape': (" + std::to_string(rows) + ", " +
                std::to_string(columns) + "), }");
}

}  // namespace pointfair::io::npy
