// SPDX-License-Identifier: Apache-2.0
#include "io/file_bytes.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>

#include "platform/files.hpp"
#include "platform/path_text.hpp"
#include "pointfair/cloud.hpp"

namespace pointfair::io {
namespace {

std::string system_message() { return platform::message_of(errno); }

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) platform::close_file(fd_);
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
  return path.empty() ? "''" : platform::text_of(path);
}

FileBytes FileBytes::copy(std::span<const std::byte> bytes) {
  auto owned = std::make_unique_for_overwrite<char[]>(bytes.size());
  if (!bytes.empty()) std::memcpy(owned.get(), bytes.data(), bytes.size());
  const std::string_view view(owned.get(), bytes.size());
  return FileBytes(std::shared_ptr<char[]>(std::move(owned)), view);
}

FileBytes FileBytes::open(const std::filesystem::path& path) {
  const std::string name = shown_name(path, true);
  const Descriptor file(path == "-" ? platform::standard_input() : platform::open_file(path, platform::Opening::read));
  if (file.get() < 0) fail(name, "cannot open: " + system_message());
  const auto status = platform::status_of(file.get());
  if (!status) fail(name, "cannot open: " + system_message());
  if (status->kind == platform::FileStatus::Kind::folder) fail(name, "is a directory; name a file in it");

  const bool whole = status->kind == platform::FileStatus::Kind::regular && platform::is_at_begin(file.get());
  if (whole && status->size > 0) {
    const auto size = static_cast<std::size_t>(status->size);
    std::shared_ptr<const void> start = platform::map_file(file.get(), size);
    if (!start) fail(name, "cannot map: " + system_message());
    const std::string_view view(static_cast<const char*>(start.get()), size);
    return FileBytes(std::move(start), view, true);
  }

  auto buffer = std::make_shared<Buffer>(std::size_t{1} << 16);
  std::size_t size = 0;
  for (;;) {
    if (size == buffer->capacity) buffer->grow(2 * size);
    const std::ptrdiff_t got = platform::read_some(file.get(), buffer->data + size, buffer->capacity - size);
    if (got < 0) fail(name, "cannot read: " + system_message());
    if (got == 0) break;
    size += static_cast<std::size_t>(got);
  }
  const std::string_view view(buffer->data, size);
  return FileBytes(std::move(buffer), view);
}

void FileBytes::release_all() const {
  if (!is_mapped_) return;
  platform::prefer_small_pages(view_.data(), view_.size());
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
  platform::give_back(view_.data() + (from - first), to - from);
}

}  // namespace pointfair::io
