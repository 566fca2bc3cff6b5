// SPDX-License-Identifier: Apache-2.0
#include "io/xyz_front.hpp"

#include <algorithm>
#include <filesystem>

#include "io/column_names.hpp"
#include "io/file_bytes.hpp"
#include "io/text.hpp"
#include "io/text_source.hpp"
#include "platform/path_text.hpp"

namespace pointfair::io {
namespace {

using Words = std::vector<std::string_view>;

constexpr std::size_t kFrontLines = 1000;  // more of them without a number are no front
constexpr const char* kAdvice = "; say what the columns are, as in --columns x,y,z,i";

std::size_t tabs_in(std::string_view line) { return static_cast<std::size_t>(std::ranges::count(line, '\t')); }

std::string_view trimmed(std::string_view line) {
  while (!line.empty() && is_blank(line.back())) line.remove_suffix(1);
  return line;
}

// A line that may name the columns, and how.
struct Names {
  std::string_view line;
  std::vector<std::string> names;
  char separator = ' ';
};

// Within quotes two stand for one.
std::string name_in(std::string_view word, bool is_quoted) {
  std::string name(word);
  for (std::size_t at = 0; is_quoted && (at = name.find("\"\"", at)) != std::string::npos; ++at) name.erase(at, 1);
  return name;
}

// The names in a line whose words are separated so. A unit, "[m]", belongs to the name before it.
Names names_in(std::string_view line, char separator) {
  Names result{line, {}, separator};
  for (const std::string_view word : words_of(line, separator)) {
    const bool unit =
        separator == ' ' && !result.names.empty() && word.size() > 2 && (word[0] == '[' || word[0] == '(');
    if (!unit) result.names.push_back(name_in(word, word.data() != line.data() && word.data()[-1] == '"'));
  }
  return result;
}

// Names that contain the coordinates; with none of them where the line has no such.
Names coordinates_named_in(std::string_view line) {
  std::vector<char> separators = {separator_of(line)};
  if (tabs_in(line) >= 2) separators.insert(separators[0] == ' ' ? separators.begin() : separators.end(), '\t');
  for (const char separator : separators) {
    Names names = names_in(line, separator);
    if (find_coordinates(names.names)) return names;
  }
  return {};
}

std::string_view without_remark_sign(std::string_view line) {
  const std::size_t begin = line.find_first_not_of("#/% \t");
  return begin == std::string_view::npos ? std::string_view() : line.substr(begin);
}

// What the columns behind the coordinates are called where no line tells.
std::vector<std::string> usual_names(Format format, const std::string& file, std::size_t columns) {
  const std::string extension = lower_case(platform::text_of(platform::path_of(file).extension()));
  std::vector<std::string> names = {"x", "y", "z"};
  if (format == Format::pts && (columns == 4 || columns == 7)) names.emplace_back("intensity");
  if ((format == Format::pts && (columns == 6 || columns == 7)) || (extension == ".xyzrgb" && columns == 6))
    names.insert(names.end(), {"red", "green", "blue"});
  if (extension == ".xyzn" && columns == 6) names.insert(names.end(), {"nx", "ny", "nz"});
  return names;
}

class FrontReader {
 public:
  FrontReader(std::string_view text, const std::string& name, const ReadOptions& options, Format format)
      : text_(text), name_(name), options_(options), format_(format) {
    front_.line_end = line_end_of(text);
    rest_ = text.substr(byte_order_mark(text));
    std::string_view line;
    for (std::uint64_t skipped = 0; skipped < options.skip_lines && next_line(rest_, line, front_.line_end);) ++skipped;
  }

  XyzFront read() {
    std::string_view line;
    for (;;) {
      front_.end = text_.size() - rest_.size();
      if (!next_line(rest_, line, front_.line_end)) fail_without_rows();
      if (line.find('\0') != std::string_view::npos)
        fail(name_, "line " + std::to_string(line_number(text_, line.data())) +
                        ": holds bytes that are no text; is it another format, or damaged?");
      if (!is_row(line, RowRule::uncommented)) {
        take_remark(line);
      } else if (!take_count(line)) {
        if (is_point(line)) break;
        take_front_line(line);
      }
    }
    take_first_row(trimmed(line));
    return std::move(front_);
  }

 private:
  [[noreturn]] void fail_without_rows() const {
    if (front_lines_.empty()) fail(name_, "has no points; choose another file");
    fail_nameless(names_in(front_lines_.front(), separator_of(front_lines_.front())).names);
  }

  [[noreturn]] void fail_nameless(const std::vector<std::string>& names) const {
    const AxisColumns axes = find_axes(names);
    const auto axis = std::ranges::find(axes, names.size()) - axes.begin();
    if (axis == 3) fail(name_, "no line has numbers in the columns of the coordinates; choose another file");
    fail(name_, "no column is called '" + std::string(1, static_cast<char>('x' + axis)) + "', there are " +
                    listed(names) + kAdvice + ", or pass over titles with --skip N");
  }

  void take_remark(std::string_view line) {
    const std::string_view text = without_remark_sign(trimmed(line));
    if (text.empty()) return;
    Names names = coordinates_named_in(text);
    if (names.names.empty()) {
      front_.has_titles = true;
    } else {
      remark_ = std::move(names);
    }
  }

  // A line with nothing but a whole number says how many rows follow.
  bool take_count(std::string_view line) {
    const Words words = words_of(line);
    if (front_.count || words.size() != 1 || !to_count(words[0])) return false;
    front_.count = to_count(words[0]);
    return true;
  }

  bool is_number(std::string_view word, char separator) const {
    return to_number(word) || (separator != ',' && is_comma_number(word));
  }

  // Whether the coordinates are numbers, or missing where others are there.
  bool is_point(std::string_view line) const {
    char separator = separator_of(line);
    if (!names_.names.empty() && names_.separator == '\t' && tabs_in(line) == tabs_in(names_.line)) separator = '\t';
    const Words words = words_of(line, separator);
    AxisColumns axes{0, 1, 2};
    if (!options_.columns.empty()) {
      axes = find_axes(options_.columns);
    } else if (const auto named = find_coordinates(names_.names)) {
      axes = *named;
    }
    const bool any = std::ranges::any_of(words, [](std::string_view word) { return !word.empty(); });
    const std::size_t most = *std::ranges::max_element(axes);
    if (words.size() <= most && words.size() >= 3) return false;
    return any && std::ranges::all_of(axes, [&](std::size_t axis) {
             if (axis >= words.size()) return is_number(words[0], separator);  // too few values, as will be said
             return is_number(words[axis], separator) || (words[axis].empty() && separator != ' ');
           });
  }

  void take_front_line(std::string_view line) {
    if (front_lines_.size() == kFrontLines) fail_without_rows();
    front_lines_.push_back(line);
    if (!names_.names.empty()) {
      front_.is_doubtful = front_.is_doubtful || !is_of_units(trimmed(line));
      front_.has_titles = true;
    } else {
      names_ = coordinates_named_in(trimmed(line));
    }
  }

  // Behind the names, a line with as many words is one of units, with letters for the coordinates, and no digits. Else
  // it is a row with something wrong, which must not be passed over.
  bool is_of_units(std::string_view line) const {
    const Words words = words_of(line, names_.separator);
    const auto axes = find_coordinates(names_.names);
    if (!axes || words.size() != names_.names.size()) return false;
    const auto has = [&](auto is_it) {
      return std::ranges::any_of(*axes, [&](std::size_t axis) { return std::ranges::any_of(words[axis], is_it); });
    };
    const bool digits = has([](char c) { return c >= '0' && c <= '9'; });
    const bool letters = has([](char c) { return static_cast<unsigned char>(c | 32) >= 'a'; });
    if (!digits && letters) return true;
    for (const std::size_t axis : *axes)
      if (!is_number(words[axis], names_.separator)) fail_row(line, words[axis]);
    return false;
  }

  [[noreturn]] void fail_row(std::string_view line, std::string_view word) const {
    fail(name_, "line " + std::to_string(line_number(text_, line.data())) + ": " + quoted(word) + " is not a number; " +
                    (word.find(',') != std::string_view::npos
                         ? "export numbers with a decimal point, and thousands without separators"
                         : "repair or remove the line"));
  }

  void take_first_row(std::string_view line) {
    front_.separator = separator_of(line);
    const Names& named = names_.names.empty() ? remark_ : names_;
    const bool by_tabs = named.separator == '\t' && tabs_in(line) > 0;
    if (by_tabs && tabs_in(line) == tabs_in(named.line)) front_.separator = '\t';
    front_.is_doubtful = front_.is_doubtful || (by_tabs && front_.separator != '\t');
    const Words words = words_of(line, front_.separator);
    front_.columns = words.size();
    take_names(words);
    find_decimal();
  }

  void take_names(const Words& words) {
    if (!options_.columns.empty()) {
      front_.names = options_.columns;
      front_.has_titles = front_.has_titles || !front_lines_.empty();
      if (front_.names.size() > front_.columns)
        fail(name_, "--columns names " + std::to_string(front_.names.size()) + " columns, the first row has " +
                        std::to_string(front_.columns));
    } else if (!names_.names.empty()) {
      take(names_, names_.line);
      // R leaves the column with the numbers of the rows without a name
      if (front_.separator == ' ' && words.size() == front_.names.size() + 1 && words[0].data()[-1] == '"')
        front_.names.insert(front_.names.begin(), "row");
    } else if (names_columns(remark_.names, words.size())) {
      take(remark_, remark_.line);
    } else {
      for (const std::string_view line : front_lines_) check_title(line, words.size());
      front_.has_titles = front_.has_titles || !front_lines_.empty() || !remark_.names.empty();
      front_.names = usual_names(format_, name_, words.size());
      front_.is_by_place = true;
      if (begins_with_numbers_of_points())
        fail(name_,
             "the first column numbers the points, so it is no coordinate; name the columns, as with --columns "
             "id,x,y,z");
    }
    front_.named = front_.names.size();
    while (front_.names.size() < front_.columns)
      front_.names.push_back("column_" + std::to_string(front_.names.size() + 1));
    const auto axes = find_coordinates(front_.names);
    if (!axes) fail_nameless(front_.names);
    front_.coordinates = *axes;
    make_distinct(front_.names);
  }

  // A remark that has a word for each column; but normals or colours that the extension tells of go before others.
  bool names_columns(const std::vector<std::string>& names, std::size_t columns) const {
    constexpr std::size_t kCoordinates = 3;
    if (names.size() != columns) return false;
    const std::vector<std::string> usual = usual_names(format_, name_, columns);
    if (format_ == Format::pts || usual.size() == kCoordinates) return true;
    return std::ranges::any_of(names, [&](const auto& name) { return ply_name(name) == usual.back(); });
  }

  void take(const Names& names, std::string_view line) {
    front_.names = names.names;
    front_.names_end = static_cast<std::size_t>(trimmed(line).data() + trimmed(line).size() - text_.data());
    front_.names_separator = names.separator;
  }

  // As many words as there are columns, and no number among them, are names; two coordinates and a third that is none
  // are a row.
  void check_title(std::string_view line, std::size_t columns) const {
    for (const char separator : {front_.separator, separator_of(line)}) {
      const Words words = words_of(line, separator);
      const bool numbers = std::ranges::any_of(words, [](auto word) { return to_number(word).has_value(); });
      if (words.size() == columns && !numbers) fail_nameless(names_in(line, separator).names);
      if (words.size() != columns || columns < 3) continue;
      const auto first = words.begin(), end = words.begin() + 3;
      const auto is_word = [&](std::string_view word) { return !is_number(word, separator); };
      if (std::count_if(first, end, is_word) == 1) fail_row(line, *std::find_if(first, end, is_word));
    }
  }

  // As lists of surveyed points do: whole numbers that only grow, before three columns of fractions.
  bool begins_with_numbers_of_points() const {
    constexpr std::size_t kLooked = 65536, kFewest = 8;
    std::string_view rows = text_.substr(front_.end, kLooked), line;
    std::uint64_t before = 0;
    std::size_t found = 0;
    const bool goes_on = text_.size() > front_.end + kLooked;
    while (next_line(rows, line, front_.line_end) && !(goes_on && rows.empty())) {
      if (!is_row(line, RowRule::uncommented)) continue;
      const Words words = words_of(line, front_.separator);
      const auto number = words.empty() ? std::nullopt : to_count(words[0]);
      const auto is_fraction = [](std::string_view word) { return word.find_first_of(".,") != std::string_view::npos; };
      if (!number || words.size() < 4 || !std::all_of(words.begin() + 1, words.begin() + 4, is_fraction)) return false;
      if (found++ > 0 && *number <= before) return false;
      before = *number;
    }
    return found >= kFewest;
  }

  // Decimal commas show in the first rows.
  void find_decimal() {
    constexpr std::size_t kLooked = 65536;
    if (front_.separator == ',') return;
    std::string_view rows = text_.substr(front_.end, kLooked), line;
    while (next_line(rows, line, front_.line_end)) {
      if (!is_row(line, RowRule::uncommented)) continue;
      const Words words = words_of(line, front_.separator);
      for (const std::size_t axis : front_.coordinates)
        if (axis < words.size() && is_comma_number(words[axis])) front_.decimal = ',';
    }
  }

  std::string_view text_, rest_;
  const std::string& name_;
  const ReadOptions& options_;
  Format format_;
  XyzFront front_;
  Names names_, remark_;
  std::vector<std::string_view> front_lines_;
};

}  // namespace

XyzFront read_xyz_front(std::string_view text, const std::string& name, const ReadOptions& options, Format format) {
  return FrontReader(text, name, options, format).read();
}

}  // namespace pointfair::io
