// SPDX-License-Identifier: Apache-2.0
#include "io/materials.hpp"

#include <algorithm>

#include "io/text.hpp"

namespace pointfair::io {
namespace {

// How many words follow an option of a picture; those of the last three take up to three numbers.
struct Option {
  std::string_view name;
  int words;
};
constexpr Option kOptions[] = {{"-blendu", 1}, {"-blendv", 1}, {"-cc", 1},      {"-clamp", 1}, {"-boost", 1},
                               {"-bm", 1},     {"-mm", 2},     {"-imfchan", 1}, {"-type", 1},  {"-texres", 1},
                               {"-o", 0},      {"-s", 0},      {"-t", 0}};

// Passes over the options before a picture's name; whether one of them moves, scales or turns the picture.
bool take_options(std::string_view& rest) {
  constexpr int kMostNumbers = 3;
  bool altered = false;
  std::string_view word, after = rest;
  while (next_word(after, word)) {
    const auto option = std::ranges::find(kOptions, lower_case(word), &Option::name);
    if (option == std::end(kOptions)) break;
    for (int i = 0; i < option->words; ++i) next_word(after, word);
    rest = after;
    altered = altered || option->words == 0;
    for (int i = 0; option->words == 0 && i < kMostNumbers; ++i) {
      if (!next_word(after, word) || !to_number(word)) break;
      rest = after;
    }
    after = rest;
  }
  return altered;
}

}  // namespace

std::vector<LibraryPicture> library_pictures(std::string_view text) {
  std::vector<LibraryPicture> pictures;
  std::string material;
  text.remove_prefix(byte_order_mark(text));
  while (!text.empty()) {
    const std::size_t end = std::min(text.find_first_of("\r\n"), text.size());
    std::string_view line = text.substr(0, end), key;
    text.remove_prefix(std::min(end + 1, text.size()));
    if (!next_word(line, key)) continue;
    if (lower_case(key) == "newmtl") material = without_blanks(line);
    if (lower_case(key) != "map_kd") continue;
    const bool altered = take_options(line);
    if (const std::string_view name = without_blanks(line); !name.empty())
      pictures.push_back({material, std::string(name), altered});
  }
  return pictures;
}

}  // namespace pointfair::io
