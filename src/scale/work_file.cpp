// SPDX-License-Identifier: Apache-2.0
#include "scale/work_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

#include "io/unfinished_files.hpp"
#include "pointfair/cloud.hpp"

namespace pointfair::scale {
namespace fs = std::filesystem;
namespace {

constexpr std::string_view kUnfinished = ".unfinished-";

std::string message_of(int error) { return std::system_category().message(error); }

[[noreturn]] void fail_to_read(const fs::path& path, const std::string& why) {
  throw Error(ErrorKind::file, path.string() + ": " + why);
}

// The name is on the disk, too.
void sync_folder(const fs::path& folder) {
  const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;
  (void)::fsync(fd);
  ::close(fd);
}

}  // namespace

NewFile::NewFile(const fs::path& path, std::uint64_t size) : path_(path), size_(size) {
  temporary_ = path.parent_path() / io::unfinished_name(kUnfinished);
  fd_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (fd_ < 0) fail(errno);
}

NewFile::~NewFile() {
  if (fd_ < 0) return;
  ::close(fd_);
  ::unlink(temporary_.c_str());
}

void NewFile::fail(int error) const {
  std::string message = path_.string() + ": cannot write: " + message_of(error);
  if (error == ENOSPC || error == EDQUOT) {
    const std::uint64_t missing = std::max<std::uint64_t>(size_, written_ + 1) - written_;
    message += "; this file needs " + std::to_string(missing) +
               " bytes more: free some space and run again, what is finished is kept";
  }
  throw Error(ErrorKind::file, message);
}

void NewFile::write(const void* data, std::size_t bytes) {
  const char* from = static_cast<const char*>(data);
  while (bytes > 0) {
    const ssize_t done = ::write(fd_, from, bytes);
    if (done < 0 && errno == EINTR) continue;
    if (done <= 0) fail(done < 0 ? errno : ENOSPC);
    from += done;
    bytes -= static_cast<std::size_t>(done);
    written_ += static_cast<std::uint64_t>(done);
  }
}

void NewFile::finish(bool name_too) {
  if (::fsync(fd_) != 0) fail(errno);
  if (::close(std::exchange(fd_, -1)) != 0) fail(errno);
  if (::rename(temporary_.c_str(), path_.c_str()) != 0) fail(errno);
  if (name_too) sync_folder(path_.parent_path());
}

StoredFile::StoredFile(const fs::path& path) : path_(path), fd_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {
  if (fd_ < 0) fail_to_read(path, "cannot open: " + message_of(errno));
}

StoredFile::~StoredFile() { ::close(fd_); }

void StoredFile::read(std::uint64_t at, void* data, std::size_t bytes) const {
  char* to = static_cast<char*>(data);
  while (bytes > 0) {
    const ssize_t got = ::pread(fd_, to, bytes, static_cast<off_t>(at));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail_to_read(path_, "cannot read: " + message_of(errno));
    if (got == 0) fail_to_read(path_, "ends early; remove it and run again");
    to += got;
    bytes -= static_cast<std::size_t>(got);
    at += static_cast<std::uint64_t>(got);
  }
}

std::uint64_t StoredFile::size() const {
  struct stat status {};
  if (::fstat(fd_, &status) != 0) fail_to_read(path_, "cannot read: " + message_of(errno));
  return static_cast<std::uint64_t>(status.st_size);
}

void remove_abandoned_files(const fs::path& folder) { io::remove_abandoned(folder, kUnfinished); }

void mark(const fs::path& path) { NewFile(path).finish(); }

std::string read_text(const fs::path& path) {
  const StoredFile file(path);
  std::string text(static_cast<std::size_t>(file.size()), '\0');
  file.read(0, text.data(), text.size());
  return text;
}

}  // namespace pointfair::scale
