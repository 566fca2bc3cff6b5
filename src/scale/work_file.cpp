// SPDX-License-Identifier: Apache-2.0
#include "scale/work_file.hpp"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <map>
#include <mutex>
#include <utility>

#include "io/unfinished_files.hpp"
#include "platform/files.hpp"
#include "platform/path_text.hpp"
#include "pointfair/cloud.hpp"

namespace pointfair::scale {
namespace fs = std::filesystem;
namespace {

constexpr std::string_view kUnfinished = ".unfinished-";

using platform::message_of;

[[noreturn]] void fail_to_read(const fs::path& path, const std::string& why) {
  throw Error(ErrorKind::file, platform::text_of(path) + ": " + why);
}

// Finished files of all folders in memory, by their paths.
class FilesInMemory {
 public:
  static bool has(const fs::path& path) { return platform::text_of(path).starts_with(kRoot); }
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
  fd_ = platform::open_file(temporary_, platform::Opening::replace);
  if (fd_ < 0) fail(errno);
}

NewFile::~NewFile() {
  if (fd_ >= 0) platform::close_file(fd_);
  if (!temporary_.empty() && !is_finished_) platform::remove_file(temporary_.c_str());
}

void NewFile::fail(int error) const {
  std::string message = platform::text_of(path_) + ": cannot write: " + message_of(error);
  if (platform::is_full(error)) {
    const std::uint64_t missing = std::max<std::uint64_t>(size_, written_ + 1) - written_;
    message += "; this file needs " + std::to_string(missing) +
               " bytes more: free some space and run again; with --work, what is finished is kept";
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
    const std::ptrdiff_t done = platform::write_some(fd_, from, bytes);
    if (done <= 0) fail(done < 0 ? errno : ENOSPC);
    from += done;
    bytes -= static_cast<std::size_t>(done);
    written_ += static_cast<std::uint64_t>(done);
  }
}

void NewFile::finish(bool name_too) {
  if (content_) return FilesInMemory::all().put(path_, std::move(content_));
  if (platform::sync_file(fd_) != 0) fail(errno);
  if (platform::close_file(std::exchange(fd_, -1)) != 0) fail(errno);
  if (platform::rename_over(temporary_, path_) != 0) fail(errno);
  is_finished_ = true;
  if (name_too) platform::sync_folder(path_.parent_path());
}

StoredFile::StoredFile(const fs::path& path) : path_(path) {
  if (FilesInMemory::has(path)) {
    content_ = FilesInMemory::all().find(path);
    if (!content_) fail_to_read(path, "is not there");
    return;
  }
  fd_ = platform::open_file(path, platform::Opening::read);
  if (fd_ < 0) fail_to_read(path, "cannot open: " + message_of(errno));
}

StoredFile::~StoredFile() {
  if (fd_ >= 0) platform::close_file(fd_);
}

void StoredFile::read(std::uint64_t at, void* data, std::size_t bytes) const {
  char* to = static_cast<char*>(data);
  if (content_) {
    if (at > content_->size() || bytes > content_->size() - at) fail_to_read(path_, "ends early");
    if (bytes > 0) std::memcpy(to, content_->data() + at, bytes);
    return;
  }
  while (bytes > 0) {
    const std::ptrdiff_t got = platform::read_some_at(fd_, to, bytes, at);
    if (got < 0) fail_to_read(path_, "cannot read: " + message_of(errno));
    if (got == 0) fail_to_read(path_, "ends early; remove it and run again");
    to += got;
    bytes -= static_cast<std::size_t>(got);
    at += static_cast<std::uint64_t>(got);
  }
}

std::uint64_t StoredFile::size() const {
  if (content_) return content_->size();
  const auto status = platform::status_of(fd_);
  if (!status) fail_to_read(path_, "cannot read: " + message_of(errno));
  return status->size;
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
