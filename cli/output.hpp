// SPDX-License-Identifier: Apache-2.0
// Where a command's results go: exit codes, lines on the terminal, and the checks made before any work is done.
#pragma once

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "pointfair/cloud.hpp"

namespace pointfair::cli {

inline constexpr int kExitOk = 0, kExitFailed = 1, kExitUsage = 2, kExitFile = 3, kExitMemory = 4, kExitDevice = 5,
                     kExitInterrupted = 130;

int exit_code(ErrorKind kind);

/// Of several that failed: what all have in common, else ErrorKind::failed. At least one.
ErrorKind common_kind(std::span<const ErrorKind> kinds);

/// Prints to standard error. Where that is closed or full, nothing is said, and the run goes on: fmt::print would
/// throw.
template <class... Values>
void print_message(fmt::format_string<Values...> format, Values&&... values) {
  const std::string text = fmt::format(format, std::forward<Values>(values)...);
  std::fwrite(text.data(), 1, text.size(), stderr);
}

/// Prints "pointfair: message" on standard error, as one line whatever the message holds.
void print_error(std::string_view message);

/// Prints to standard output. Throws ErrorKind::file if it cannot take the text.
void print_output(std::string_view text);

/// Whether a path is "-", a pipe or a device that takes bytes one after the other, such as <(command) of a shell: it
/// can be read once, and a write replaces nothing.
bool is_stream(const std::filesystem::path& path);

/// Throws ErrorKind::file if `path` cannot be created: it exists, is no stream, and `overwrite` is false, it is a
/// directory, or its folder is missing or read-only. "-" always passes.
void check_writable(const std::filesystem::path& path, bool overwrite);

/// A folder for results, made if it is not there, which goes again at the end if nothing came into it. Throws
/// ErrorKind::file if it cannot be made.
class ResultFolder {
 public:
  explicit ResultFolder(std::filesystem::path folder);
  ~ResultFolder();
  ResultFolder(const ResultFolder&) = delete;
  ResultFolder& operator=(const ResultFolder&) = delete;

 private:
  std::filesystem::path folder_;
  bool is_new_ = false;
};

/// Whether two paths lead to one file, also where it is not there yet.
bool are_one_file(const std::filesystem::path& a, const std::filesystem::path& b);

/// Throws ErrorKind::usage if `output` is the file `input` under whatever name.
void check_not_same(const std::filesystem::path& input, const std::filesystem::path& output, std::string_view advice);

/// Writes a whole text file, under its name only when it is complete; "-" is standard output. The file that a link
/// names is replaced, not the link, and keeps its permissions. Throws ErrorKind::file.
void write_text(const std::filesystem::path& path, std::string_view text);

}  // namespace pointfair::cli
