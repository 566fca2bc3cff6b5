// SPDX-License-Identifier: Apache-2.0
#include "io/unfinished_files.hpp"

#include <atomic>
#include <charconv>
#include <system_error>

#include "platform/path_text.hpp"
#include "platform/process.hpp"

namespace pointfair::io {
namespace fs = std::filesystem;
namespace {

std::atomic<unsigned> next_number{0};

std::string of_this_machine(std::string_view prefix) { return std::string(prefix) + platform::machine_name() + "-"; }

// Of "PROCESS-NUMBER". A process of the same id may have been here before: its numbers were not given out yet, or the
// file would be this process's own.
bool is_abandoned(std::string_view owner) {
  int process = 0;
  unsigned number = 0;
  const char* const end = owner.data() + owner.size();
  const auto [at, error] = std::from_chars(owner.data(), end, process);
  if (error != std::errc() || process <= 0 || at == end || *at != '-') return false;
  if (std::from_chars(at + 1, end, number).ec != std::errc()) return false;
  if (process == platform::process_id()) return number >= next_number;
  return !platform::is_alive(process);
}

}  // namespace

std::string unfinished_name(std::string_view prefix) {
  return of_this_machine(prefix) + std::to_string(platform::process_id()) + "-" + std::to_string(next_number++);
}

void remove_abandoned(const fs::path& folder, std::string_view prefix) noexcept {
  std::error_code error;
  const std::string ours = of_this_machine(prefix);
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    const std::string name = platform::text_of(at->path().filename());
    std::error_code ignored;
    if (name.starts_with(ours) && is_abandoned(std::string_view(name).substr(ours.size())))
      fs::remove_all(at->path(), ignored);
  }
}

}  // namespace pointfair::io
