// SPDX-License-Identifier: Apache-2.0
#include "misunderstood.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

namespace pointfair::cli {
namespace {

using Names = std::vector<std::string>;

// Letters that are added, lost, replaced or swapped with the next one (optimal string alignment).
std::size_t edits_between(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> edits(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        edits[i][j] = i + j;
        continue;
      }
      const std::size_t replaced = edits[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      edits[i][j] = std::min({edits[i - 1][j] + 1, edits[i][j - 1] + 1, replaced});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) edits[i][j] = std::min(edits[i][j], edits[i - 2][j - 2] + 1);
    }
  }
  return edits.back().back();
}

constexpr std::size_t kTypos = 2;

// Empty where none is within `most` edits.
std::string nearest(std::string_view word, const Names& names, std::size_t most) {
  std::string closest;
  std::size_t fewest = most + 1;
  for (const std::string& name : names) {
    const std::size_t edits = edits_between(word, name);
    if (edits >= fewest) continue;
    fewest = edits;
    closest = name;
  }
  return closest;
}

Names subcommands_of(const CLI::App& command) {
  Names names;
  for (const CLI::App* its : command.get_subcommands({})) names.push_back(its->get_name());
  return names;
}

// Without their dashes.
Names flags_of(const CLI::App& command) {
  Names names;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back(name);
  return names;
}

// A flag as another program might call it: "--Similarity_Sigma=1s", "-k".
std::string bare(std::string_view flag) {
  flag = flag.substr(0, flag.find('='));
  flag.remove_prefix(std::min(flag.find_first_not_of('-'), flag.size()));
  std::string name(flag);
  for (char& c : name) c = c == '_' ? '-' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return name;
}

std::string guess_of_flag(const std::string& name, const CLI::App& command) {
  if (name.empty()) return {};
  const Names flags = flags_of(command);
  const std::size_t most = std::min(kTypos, (name.size() - 1) / 2);  // as many as half of a word are no typo
  if (const std::string near = nearest(name, flags, most); !near.empty()) return near;
  const auto begins = [&](const std::string& flag) { return name.size() > 2 && flag.starts_with(name); };
  const auto found = std::ranges::find_if(flags, begins);
  return found == flags.end() ? std::string() : *found;
}

// As compilers have it.
bool asks_for_output(const std::string& name) { return name == "o" || name == "output"; }

std::string unknown_flag(const std::string& flag, const CLI::App& command) {
  std::string text = fmt::format("there is no flag {}", flag.substr(0, flag.find('=')));
  const std::string name = bare(flag);
  if (asks_for_output(name) && command.get_option_no_throw("OUT"))
    return text + fmt::format("; the output stands behind the input: {} IN OUT", words_of(&command));
  const std::string guess = guess_of_flag(name, command);
  return guess.empty() ? text : text + fmt::format("; did you mean --{}?", guess);
}

// Empty where there is none among the words that were left.
std::string leftover_flag(const CLI::App& app) {
  const Names words = app.remaining(true);
  const auto flag = std::ranges::find_if(words, [](const auto& word) { return word.starts_with('-'); });
  return flag == words.end() ? std::string() : *flag;
}

std::string unexpected(CLI::App& app) {
  const CLI::App& command = asked_command(app);
  if (const std::string flag = leftover_flag(app); !flag.empty()) return unknown_flag(flag, command);
  const Names words = app.remaining(true);
  return fmt::format("{} has no place for '{}'", words_of(&command), words.empty() ? "" : words.front());
}

// "--noise: 1 required LENGTH|auto missing", as CLI11 has it.
std::string missing_value(const std::string& text) {
  constexpr std::string_view kFront = ": 1 required ", kBack = " missing";
  const std::size_t front = text.find(kFront);
  if (front == std::string::npos || !text.ends_with(kBack)) return text;
  const std::size_t value = front + kFront.size();
  return fmt::format("{} needs a value, {}", text.substr(0, front),
                     text.substr(value, text.size() - kBack.size() - value));
}

// "Could not convert: --port = 99999"
std::string no_such_value(const std::string& text) {
  constexpr std::string_view kFront = "Could not convert: ", kMiddle = " = ";
  const std::size_t middle = text.find(kMiddle);
  if (!text.starts_with(kFront) || middle == std::string::npos) return text;
  return fmt::format("{} cannot be '{}'", text.substr(kFront.size(), middle - kFront.size()),
                     text.substr(middle + kMiddle.size()));
}

// "Value 400 not in range 0.000000 to 180.000000"
std::string without_zeros(std::string text) {
  constexpr std::string_view kZeros = ".000000";
  for (std::size_t at = 0; (at = text.find(kZeros, at)) != std::string::npos;) text.erase(at, kZeros.size());
  return text;
}

}  // namespace

std::string words_of(const CLI::App* command) {
  if (!command->get_parent()) return "pointfair";
  return words_of(command->get_parent()) + " " + command->get_name();
}

CLI::App& asked_command(CLI::App& app) {
  CLI::App* command = &app;
  while (!command->get_subcommands().empty()) command = command->get_subcommands().front();
  return *command;
}

std::string unknown_verb(const std::string& word, const CLI::App& app) {
  std::error_code ignored;
  if (std::filesystem::exists(word, ignored))
    return fmt::format("{} is no verb; one comes before the files: pointfair run {} OUT", word, word);
  // Python's name for it; "noise", which is near, does the opposite
  const std::string guess = word == "denoise" ? "run" : nearest(word, subcommands_of(app), kTypos);
  return fmt::format("there is no verb {}; {}", word,
                     guess.empty() ? "pointfair --help lists them" : fmt::format("did you mean {}?", guess));
}

std::string told(const CLI::ParseError& error, CLI::App& app) {
  CLI::App& command = asked_command(app);
  const Names parts = subcommands_of(command);
  std::string text = error.what();
  const bool is_missing = dynamic_cast<const CLI::RequiredError*>(&error) != nullptr;
  if (dynamic_cast<const CLI::ExtrasError*>(&error) || (is_missing && !leftover_flag(app).empty())) {
    text = unexpected(app);
    if (text.ends_with('?')) return text;
  } else if (is_missing && !parts.empty()) {
    text = fmt::format("{} is followed by one of {}", words_of(&command), fmt::join(parts, ", "));
  } else if (dynamic_cast<const CLI::ArgumentMismatch*>(&error)) {
    text = missing_value(text);
  } else if (dynamic_cast<const CLI::ConversionError*>(&error)) {
    text = no_such_value(text);
  } else if (dynamic_cast<const CLI::ValidationError*>(&error)) {
    text = without_zeros(text);
  }
  return fmt::format("{}; see {} --help", text, words_of(&command));
}

}  // namespace pointfair::cli
