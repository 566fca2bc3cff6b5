// SPDX-License-Identifier: Apache-2.0
#include "scale/work_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <map>
#include <mutex>
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

// Finished files of all folders in memory, by their paths.
class FilesInMemory {
 public:
  static bool has(const fs::path& path) { return path.native().starts_with(kRoot); }
  static fs::path new_folder() {
    static std::atomic<std::uint64_t> number = 0;
    return kRoot + std::to_string(number++);
  }
  static FilesInMemory& all() {
    static FilesInMemory files;
    return files;
  }

  void put(const fs::path& path, std::shared_ptr<const FileContent> content) {
    const std::lock_guard lock(mutex_);
    files_[path] = std::move(content);
  }
  std::shared_ptr<const FileContent> find(const fs::path& path) const {
    const std::lock_guard lock(mutex_);
    const auto its = files_.find(path);
    return its == files_.end() ? nullptr : its->second;
  }
  void remove(const fs::path& path) {
    const std::lock_guard lock(mutex_);
    files_.erase(path);
  }
  void remove_folder(const fs::path& folder) {
    const std::lock_guard lock(mutex_);
    std::erase_if(files_, [&](const auto& file) { return file.first.parent_path() == folder; });
  }

 private:
  inline static const std::string kRoot = "/dev/null/pointfair-memory-";  // where no disk has a file
  mutable std::mutex mutex_;
  std::map<fs::path, std::shared_ptr<const FileContent>> files_;
};

// The name is on the disk, too.
void sync_folder(const fs::path& folder) {
  const int fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return;
  (void)::fsync(fd);
  ::close(fd);
}

}  // namespace

MemoryFolder::MemoryFolder() : path_(FilesInMemory::new_folder()) {}
MemoryFolder::~MemoryFolder() { FilesInMemory::all().remove_folder(path_); }

NewFile::NewFile(const fs::path& path, std::uint64_t size) : path_(path), size_(size) {
  if (FilesInMemory::has(path)) {
    content_ = std::make_unique<FileContent>();
    content_->reserve(static_cast<std::size_t>(size));
    return;
  }
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
  if (content_) {
    const auto* const begin = reinterpret_cast<const std::byte*>(from);
    content_->insert(content_->end(), begin, begin + bytes);
    return;
  }
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
  if (content_) return FilesInMemory::all().put(path_, std::move(content_));
  if (::fsync(fd_) != 0) fail(errno);
  if (::close(std::exchange(fd_, -1)) != 0) fail(errno);
  if (::rename(temporary_.c_str(), path_.c_str()) != 0) fail(errno);
  if (name_too) sync_folder(path_.parent_path());
}

StoredFile::StoredFile(const fs::path& path) : path_(path) {
  if (FilesInMemory::has(path)) {
    content_ = FilesInMemory::all().find(path);
    if (!content_) fail_to_read(path, "is not there");
    return;
  }
  fd_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd_ < 0) fail_to_read(path, "cannot open: " + message_of(errno));
}

StoredFile::~StoredFile() {
  if (fd_ >= 0) ::close(fd_);
}

void StoredFile::read(std::uint64_t at, void* data, std::size_t bytes) const {
  char* to = static_cast<char*>(data);
  if (content_) {
    if (at > content_->size() || bytes > content_->size() - at) fail_to_read(path_, "ends early");
    if (bytes > 0) std::memcpy(to, content_->data() + at, bytes);
    return;
  }
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
  if (content_) return content_->size();
  struct stat status {};
  if (::fstat(fd_, &status) != 0) fail_to_read(path_, "cannot read: " + message_of(errno));
  return static_cast<std::uint64_t>(status.st_size);
}

bool is_stored(const fs::path& path) {
  return FilesInMemory::has(path) ? FilesInMemory::all().find(path) != nullptr : fs::exists(path);
}
void remove_stored(const fs::path& path) {
  if (FilesInMemory::has(path)) return FilesInMemory::all().remove(path);
  fs::remove(path);
}

void remove_abandoned_files(const fs::path& folder) {
  if (!FilesInMemory::has(folder)) io::remove_abandoned(folder, kUnfinished);
}

void mark(const fs::path& path) { NewFile(path).finish(); }

std::string read_text(const fs::path& path) {
  const StoredFile file(path);
  std::string text(static_cast<std::size_t>(file.size()), '\0');
  file.read(0, text.data(), text.size());
  return text;
}

}  // namespace pointfair::scale
