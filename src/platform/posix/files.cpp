// SPDX-License-Identifier: Apache-2.0
#include "platform/files.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <system_error>

namespace pointfair::platform {
namespace fs = std::filesystem;
namespace {

#ifdef __APPLE__
int rename_in_one_step(const char* from, const char* to) { return ::renamex_np(from, to, RENAME_EXCL); }
constexpr int kUnknownToFileSystem = ENOTSUP;
#elif defined(__wasi__)
int rename_in_one_step(const char*, const char*) {
  errno = EINVAL;
  return -1;
}
constexpr int kUnknownToFileSystem = EINVAL;
#else
int rename_in_one_step(const char* from, const char* to) {
  return ::renameat2(AT_FDCWD, from, AT_FDCWD, to, RENAME_NOREPLACE);
}
constexpr int kUnknownToFileSystem = EINVAL;
#endif

std::timespec time_of_change(const struct stat& status) {
#ifdef __APPLE__
  return status.st_mtimespec;
#else
  return status.st_mtim;
#endif
}

FileStatus status_from(const struct stat& status) {
  using Kind = FileStatus::Kind;
  const std::timespec changed = time_of_change(status);
  return {S_ISREG(status.st_mode)   ? Kind::regular
          : S_ISDIR(status.st_mode) ? Kind::folder
                                    : Kind::other,
          static_cast<std::uint64_t>(status.st_size), static_cast<std::int64_t>(changed.tv_sec),
          static_cast<std::uint32_t>(changed.tv_nsec)};
}

// macOS refuses to read or write 2 GiB at once.
std::size_t at_once(std::size_t bytes) { return std::min(bytes, std::size_t{1} << 30); }

template <class Call>
std::ptrdiff_t repeated(const Call& call) {
  ssize_t done = 0;
  do done = call();
  while (done < 0 && errno == EINTR);
  return done;
}

}  // namespace

Descriptor open_file(const fs::path& path, Opening opening) {
  switch (opening) {
    case Opening::read:
      return ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
    case Opening::create:
      return ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    case Opening::replace:
      return ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    case Opening::device:
      break;
  }
  return ::open(path.c_str(), O_WRONLY | O_CLOEXEC);
}
Descriptor standard_input() { return STDIN_FILENO; }
Descriptor standard_output() { return STDOUT_FILENO; }
int close_file(Descriptor file) { return file > STDERR_FILENO ? ::close(file) : 0; }

std::ptrdiff_t read_some(Descriptor file, void* to, std::size_t bytes) {
  return repeated([&] { return ::read(file, to, at_once(bytes)); });
}
std::ptrdiff_t read_some_at(Descriptor file, void* to, std::size_t bytes, std::uint64_t at) {
  return repeated([&] { return ::pread(file, to, at_once(bytes), static_cast<off_t>(at)); });
}
std::ptrdiff_t write_some(Descriptor file, const void* from, std::size_t bytes) {
  return repeated([&] { return ::write(file, from, at_once(bytes)); });
}

bool is_at_begin(Descriptor file) { return ::lseek(file, 0, SEEK_CUR) == 0; }
bool go_to(Descriptor file, std::uint64_t at) { return ::lseek(file, static_cast<off_t>(at), SEEK_SET) >= 0; }
bool go_to_end(Descriptor file) { return ::lseek(file, 0, SEEK_END) >= 0; }
void make_empty(Descriptor file) { (void)!::ftruncate(file, 0); }
int sync_file(Descriptor file) {
#ifdef F_FULLFSYNC
  // fsync of macOS leaves bytes in the drive's cache; not every file system there knows better
  if (::fcntl(file, F_FULLFSYNC) == 0) return 0;
#endif
  return ::fsync(file);
}
void sync_folder(const fs::path& folder) {
  const int file = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (file < 0) return;
  (void)::fsync(file);
  ::close(file);
}

std::optional<FileStatus> status_of(Descriptor file) {
  struct stat status {};
  if (::fstat(file, &status) != 0) return std::nullopt;
  return status_from(status);
}
std::optional<FileStatus> status_of(const fs::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return std::nullopt;
  return status_from(status);
}
void take_permissions(Descriptor file, const fs::path& from) {
  struct stat status {};
  if (::stat(from.c_str(), &status) == 0) (void)::fchmod(file, status.st_mode & 07777);
}

std::optional<FileIdentity> identity_of(const fs::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return std::nullopt;
  return FileIdentity{static_cast<std::uint64_t>(status.st_dev), static_cast<std::uint64_t>(status.st_ino)};
}

std::shared_ptr<const void> map_file(Descriptor file, std::size_t size) {
  void* const start = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file, 0);
  if (start == MAP_FAILED) return nullptr;
  return {start, [size](const void* from) { ::munmap(const_cast<void*>(from), size); }};
}
void give_back(const void* from, std::size_t bytes) { ::madvise(const_cast<void*>(from), bytes, MADV_DONTNEED); }
void prefer_small_pages(const void* from, std::size_t bytes) {
#ifdef MADV_NOHUGEPAGE
  ::madvise(const_cast<void*>(from), bytes, MADV_NOHUGEPAGE);
#else
  (void)from, (void)bytes;
#endif
}

int rename_to_free_name(const fs::path& from, const fs::path& to) {
  const int renamed = rename_in_one_step(from.c_str(), to.c_str());
  if (renamed == 0 || errno != kUnknownToFileSystem || fs::exists(to)) return renamed;
  return ::rename(from.c_str(), to.c_str());
}
int rename_over(const fs::path& from, const fs::path& to) { return ::rename(from.c_str(), to.c_str()); }
void remove_file(const char* path) noexcept { ::unlink(path); }

bool is_full(int error) { return error == ENOSPC || error == EDQUOT; }
std::string message_of(int error) { return std::system_category().message(error); }

}  // namespace pointfair::platform
