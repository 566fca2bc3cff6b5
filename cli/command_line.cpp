// SPDX-License-Identifier: Apache-2.0
#include "command_line.hpp"

#include <string_view>

namespace pointfair::cli {
namespace {

std::string& remembered() {
  static std::string text = "pointfair";
  return text;
}

std::string shell_word(const std::string& word) {
  constexpr std::string_view kPlain = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-+=./:,%@";
  if (!word.empty() && word.find_first_not_of(kPlain) == std::string::npos) return word;
  std::string quoted(1, '\'');
  for (const char c : word) {
    if (c == '\'') quoted.append("'\\'");
    quoted.push_back(c);
  }
  quoted.push_back('\'');
  return quoted;
}

}  // namespace

void remember_command(const std::vector<std::string>& words) {
  for (const std::string& word : words) remembered().append(1, ' ').append(shell_word(word));
}

const std::string& command_text() { return remembered(); }

}  // namespace pointfair::cli
