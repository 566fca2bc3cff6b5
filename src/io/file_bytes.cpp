// SPDX-License-Identifier: Apache-2.0
#include "io/file_bytes.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>
#include <system_error>

#include "pointfair/cloud.hpp"

namespace pointfair::io {
namespace {

std::string system_message() { return std::system_category().message(errno); }

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ > STDERR_FILENO) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

// A buffer that grows by doubling, so that a pipe of unknown length can be read without zeroing memory first.
struct Buffer {
  explicit Buffer(std::size_t size) { grow(size); }
  ~Buffer() { std::free(data); }
  Buffer(const Buffer&) = delete;
  Buffer& operator=(const Buffer&) = delete;
  void grow(std::size_t to) {
    void* larger = std::realloc(data, to);
    if (!larger) throw Error(ErrorKind::memory, "not enough memory to hold the input");
    data = static_cast<char*>(larger);
    capacity = to;
  }
  char* data = nullptr;
  std::size_t capacity = 0;
};

}  // namespace

void fail(const std::string& name, const std::string& message) { throw Error(ErrorKind::file, name + ": " + message); }

void check_plausible(std::uint64_t points, std::uint64_t others, std::size_t bytes, std::size_t file_size,
                     const std::string& name) {
  constexpr std::uint64_t kAlways = std::uint64_t{1} << 24, kPerByte = 256;
  const std::uint64_t most = std::max(kAlways, kPerByte * file_size) / bytes;
  if (points <= most && others <= most - points) return;
  fail(name, "promises " + std::to_string(points) + " points, which a file of " + std::to_string(file_size) +
                 " bytes does not hold; copy it again");
}

std::string shown_name(const std::filesystem::path& path, bool input) {
  if (path == "-") return input ? "standard input" : "standard output";
  return path.string();
}

FileBytes FileBytes::copy(std::span<const std::byte> bytes) {
  auto owned = std::make_unique_for_overwrite<char[]>(bytes.size());
  if (!bytes.empty()) std::memcpy(owned.get(), bytes.data(), bytes.size());
  const std::string_view view(owned.get(), bytes.size());
  return FileBytes(std::shared_ptr<char[]>(std::move(owned)), view);
}

FileBytes FileBytes::open(const std::filesystem::path& path) {
  const std::string name = shown_name(path, true);
  const Descriptor file(path == "-" ? STDIN_FILENO : ::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  if (file.get() < 0 || ::fstat(file.get(), &status) != 0) fail(name, "cannot open: " + system_message());
  if (S_ISDIR(status.st_mode)) fail(name, "is a directory; name a file in it");

  const bool whole = S_ISREG(status.st_mode) && ::lseek(file.get(), 0, SEEK_CUR) == 0;
  if (whole && status.st_size > 0) {
    const auto size = static_cast<std::size_t>(status.st_size);
    void* start = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file.get(), 0);
    if (start == MAP_FAILED) fail(name, "cannot map: " + system_message());
    std::shared_ptr<const void> owner(start, [size](const void* p) { ::munmap(const_cast<void*>(p), size); });
    return FileBytes(std::move(owner), {static_cast<const char*>(start), size}, true);
  }

  auto buffer = std::make_shared<Buffer>(std::size_t{1} << 16);
  std::size_t size = 0;
  for (;;) {
    if (size == buffer->capacity) buffer->grow(2 * size);
    const ssize_t got = ::read(file.get(), buffer->data + size, buffer->capacity - size);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) fail(name, "cannot read: " + system_message());
    if (got == 0) break;
    size += static_cast<std::size_t>(got);
  }
  const std::string_view view(buffer->data, size);
  return FileBytes(std::move(buffer), view);
}

void FileBytes::release_all() const {
  if (!is_mapped_) return;
#ifdef MADV_NOHUGEPAGE
  ::madvise(const_cast<char*>(view_.data()), view_.size(), MADV_NOHUGEPAGE);
#endif
  release(view_);
}

void FileBytes::release(std::string_view part) const {
  // Around a place the system maps all pages of a window of addresses at once, or of a large folio. Windows are
  // released with each part, so that neighbours that share one read it again; folios when a part goes beyond their end.
  constexpr std::uintptr_t kWindow = std::uintptr_t{1} << 16, kFolio = std::uintptr_t{1} << 21;
  if (!is_mapped_ || part.empty()) return;
  const auto first = reinterpret_cast<std::uintptr_t>(view_.data()), last = first + view_.size();
  const auto begin = reinterpret_cast<std::uintptr_t>(part.data()), end = begin + part.size();
  const bool ends_folio = begin / kFolio != end / kFolio || end == last;
  const std::uintptr_t unit = ends_folio ? kFolio : kWindow;
  const std::uintptr_t from = std::max(first, begin / unit * unit);
  const std::uintptr_t to = std::min(last, (end + kWindow - 1) / kWindow * kWindow);
  ::madvise(const_cast<char*>(view_.data()) + (from - first), to - from, MADV_DONTNEED);
}

}  // namespace pointfair::io
