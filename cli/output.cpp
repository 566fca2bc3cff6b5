// SPDX-License-Identifier: Apache-2.0
#include "output.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <system_error>

#include "platform/system.hpp"

namespace pointfair::cli {
namespace fs = std::filesystem;
namespace {

[[noreturn]] void fail(const fs::path& path, std::string_view reason) {
  throw Error(ErrorKind::file, fmt::format("{}: {}", path.string(), reason));
}

// `name` is the path that the user gave.
void write_stream(const fs::path& path, std::string_view text, const fs::path& name) {
  errno = 0;
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(text.data(), static_cast<std::streamsize>(text.size()));
  file.close();
  if (!file) fail(name, fmt::format("cannot write: {}", std::strerror(errno != 0 ? errno : EIO)));
}

}  // namespace

int exit_code(ErrorKind kind) {
  constexpr int kCodes[] = {kExitFailed, kExitUsage, kExitFile, kExitMemory, kExitDevice, kExitInterrupted};
  return kCodes[static_cast<std::size_t>(kind)];
}

ErrorKind common_kind(std::span<const ErrorKind> kinds) {
  const bool is_common = std::ranges::all_of(kinds, [&](ErrorKind kind) { return kind == kinds.front(); });
  return is_common ? kinds.front() : ErrorKind::failed;
}

void print_error(std::string_view message) {
  std::string line = fmt::format("pointfair: {}", message);
  std::ranges::replace(line, '\n', ' ');
  if (system::errors_go_to_terminal()) line.insert(0, "\r\x1b[K");  // over a progress bar
  print_message("{}\n", line);
}

void print_output(std::string_view text) {
  errno = 0;
  if (std::fwrite(text.data(), 1, text.size(), stdout) != text.size() || std::fflush(stdout) != 0)
    fail("standard output", fmt::format("cannot write: {}", std::strerror(errno)));
}

bool is_stream(const fs::path& path) {
  std::error_code ignored;
  const fs::file_status status = fs::status(path, ignored);
  return path == "-" || fs::is_fifo(status) || fs::is_character_file(status) || fs::is_socket(status);
}

void check_writable(const fs::path& path, bool overwrite) {
  if (path == "-") return;
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (status.type() == fs::file_type::none)  // a name that is too long, for instance
    fail(path, fmt::format("cannot write: {}", error.message()));
  if (fs::is_directory(status)) fail(path, "is a folder; name a file in it");
  if (fs::exists(status)) {
    if (!overwrite && !is_stream(path)) fail(path, "exists already; add --force to replace it");
    if (const std::string why = system::why_not_writable(path); !why.empty())
      fail(path, fmt::format("cannot replace it: {}", why));
    if (!fs::is_regular_file(status)) return;  // a pipe or a device is written in place
  }
  if (fs::is_symlink(path, error) && !fs::exists(status))
    fail(path, fmt::format("is a link to {}, which is not there; remove the link, or name another file",
                           fs::read_symlink(path, error).string()));
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  if (!fs::is_directory(folder, error))
    fail(path, fmt::format("there is no folder {}; make it, or name another", folder.string()));
  if (const std::string why = system::why_no_files_in(folder); !why.empty())
    fail(path, fmt::format("cannot create files in {}: {}", folder.string(), why));
}

ResultFolder::ResultFolder(std::filesystem::path folder) : folder_(std::move(folder)) {
  std::error_code failed;
  is_new_ = std::filesystem::create_directories(folder_, failed);
  if (failed) throw Error(ErrorKind::file, folder_.string() + ": this folder cannot be made: " + failed.message());
}

ResultFolder::~ResultFolder() {
  std::error_code ignored;
  if (is_new_) std::filesystem::remove(folder_, ignored);  // not where something is in it
}

bool are_one_file(const fs::path& a, const fs::path& b) {
  std::error_code error;
  if (fs::equivalent(a, b, error)) return true;
  const fs::path name = fs::weakly_canonical(fs::absolute(a, error), error);
  return !name.empty() && name == fs::weakly_canonical(fs::absolute(b, error), error);
}

void check_not_same(const fs::path& input, const fs::path& output, std::string_view advice) {
  if (input == "-" || output == "-") return;
  std::error_code error;
  if (fs::equivalent(input, output, error))
    throw Error(ErrorKind::usage, fmt::format("{}: is input and output at once; {}", output.string(), advice));
}

void write_text(const fs::path& path, std::string_view text) {
  if (path == "-") return print_output(text);
  if (is_stream(path)) return write_stream(path, text, path);
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  const fs::path target = fs::exists(status) ? fs::canonical(path, error) : path;
  // a short name of its own: the path's may be as long as names can be
  const fs::path temporary = target.parent_path() / fmt::format(".pointfair-report-{}.tmp", system::process_id());
  try {
    write_stream(temporary, text, path);
    if (fs::exists(status)) fs::permissions(temporary, status.permissions(), error);
    fs::rename(temporary, target);
  } catch (const fs::filesystem_error& failure) {
    fs::remove(temporary, error);
    fail(path, fmt::format("cannot write: {}", failure.code().message()));
  } catch (...) {
    fs::remove(temporary, error);
    throw;
  }
}

}  // namespace pointfair::cli
