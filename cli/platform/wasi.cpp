// SPDX-License-Identifier: Apache-2.0
// WebAssembly: no signals, no other process, no thread that starts.
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "system.hpp"

namespace pointfair::cli::system {
namespace fs = std::filesystem;

static std::string why_not(const fs::path& path, int rights) {
  return ::access(path.c_str(), rights) == 0 ? std::string() : std::strerror(errno);
}

void prepare_streams() {}
bool errors_go_to_terminal() { return ::isatty(STDERR_FILENO) != 0; }
int process_id() { return ::getpid(); }
std::string why_not_writable(const fs::path& file) { return why_not(file, W_OK); }
std::string why_no_files_in(const fs::path& folder) { return why_not(folder, W_OK | X_OK); }
bool replaces_what_is_read() { return true; }
std::uint64_t peak_memory() { return 0; }
void keep_no_freed_memory() {}
bool end_with_parent(int) { return true; }
void open_browser(std::string) {}
bool pipe_is_broken() { return false; }

}  // namespace pointfair::cli::system
