// SPDX-License-Identifier: Apache-2.0
// Calls every function of src/platform, in a folder that is made and removed. Needs nothing but src/platform, so that
// it is compiled and run for a system for which the rest is not.
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>

#include "platform/aligned_memory.hpp"
#include "platform/files.hpp"
#include "platform/free_memory.hpp"
#include "platform/large_pages.hpp"
#include "platform/path_text.hpp"
#include "platform/process.hpp"

namespace fs = std::filesystem;
namespace platform = pointfair::platform;
using platform::Opening;

static int failures = 0;
#define CHECK(condition)                                            \
  do {                                                              \
    if (!(condition)) {                                             \
      std::printf("line %d: not true: %s\n", __LINE__, #condition); \
      ++failures;                                                   \
    }                                                               \
  } while (false)

static std::string content_of(const fs::path& path) {
  char bytes[64]{};
  const int file = platform::open_file(path, Opening::read);
  if (file < 0) return "cannot open";
  const std::ptrdiff_t got = platform::read_some(file, bytes, sizeof bytes);
  platform::close_file(file);
  return {bytes, static_cast<std::size_t>(got < 0 ? 0 : got)};
}

static void write_file(const fs::path& path, const std::string& text) {
  const int file = platform::open_file(path, Opening::replace);
  CHECK(file >= 0);
  CHECK(platform::write_some(file, text.data(), text.size()) == static_cast<std::ptrdiff_t>(text.size()));
  CHECK(platform::close_file(file) == 0);
}

static void check_text_of_paths(const fs::path& folder) {
  const std::string name = "gr\xc3\xb6\xc3\x9f\x65-\xe7\x82\xb9.bin";
  CHECK(platform::text_of(fs::path(u8"größe-点.bin")) == name);
  CHECK(platform::path_of(name) == fs::path(u8"größe-点.bin"));
  write_file(folder / platform::path_of(name), "x");
  CHECK(fs::exists(folder / u8"größe-点.bin"));
}

static void check_bytes(const fs::path& folder) {
  const fs::path path = folder / u8"größe-点.bin";
  const std::string text("a\nb\r\nc\x1a\0d", 9);  // what text mode changes, and its end of file
  write_file(path, text);
  CHECK(content_of(path) == text);

  const int taken = platform::open_file(path, Opening::create);
  CHECK(taken < 0 && errno == EEXIST);
  const int missing = platform::open_file(folder / "missing", Opening::read);
  CHECK(missing < 0 && errno == ENOENT);

  const int file = platform::open_file(path, Opening::read);
  char two[2]{};
  CHECK(platform::is_at_begin(file));
  CHECK(platform::read_some_at(file, two, 2, 2) == 2 && std::memcmp(two, "b\r", 2) == 0);
  CHECK(platform::read_some_at(file, two, 2, 9) == 0);
  const auto mapped = platform::map_file(file, text.size());
  const auto status = platform::status_of(file);
  CHECK(status && status->kind == platform::FileStatus::Kind::regular && status->size == text.size());
  CHECK(status && status->changed_seconds > 1'700'000'000);
  platform::close_file(file);
  CHECK(mapped && std::memcmp(mapped.get(), text.data(), text.size()) == 0);
  if (mapped) platform::prefer_small_pages(mapped.get(), text.size());
  CHECK(platform::status_of(folder)->kind == platform::FileStatus::Kind::folder);
  CHECK(!platform::status_of(folder / "missing") && errno == ENOENT);
}

// Beyond 4 GiB, in a file that has a hole.
static void check_offsets(const fs::path& folder) {
  constexpr std::uint64_t kFar = (std::uint64_t{1} << 32) + 12345;
  const fs::path path = folder / "far";
  const int file = platform::open_file(path, Opening::create);
  CHECK(platform::go_to(file, kFar) && platform::write_some(file, "end", 3) == 3);
  CHECK(platform::go_to(file, 0) && platform::write_some(file, "begin", 5) == 5 && platform::go_to_end(file));
  CHECK(platform::sync_file(file) == 0);
  platform::close_file(file);
  CHECK(platform::status_of(path)->size == kFar + 3);
  const int again = platform::open_file(path, Opening::read);
  char three[4]{};
  CHECK(platform::read_some_at(again, three, 3, kFar) == 3 && std::string(three) == "end");
  platform::close_file(again);
  platform::remove_file(path.c_str());
  CHECK(!fs::exists(path));
}

static void check_names(const fs::path& folder) {
  const fs::path a = folder / "a", b = folder / "b";
  write_file(a, "a");
  write_file(b, "b");
  CHECK(platform::identity_of(a) != platform::identity_of(b));  // two that look alike
  CHECK(platform::identity_of(a) == platform::identity_of(folder / "." / "a"));
  CHECK(!platform::identity_of(folder / "missing"));
  CHECK(platform::rename_to_free_name(a, b) != 0 && errno == EEXIST);
  CHECK(content_of(b) == "b");
  CHECK(platform::rename_over(a, b) == 0 && content_of(b) == "a" && !fs::exists(a));
  CHECK(platform::rename_to_free_name(b, a) == 0 && content_of(a) == "a" && !fs::exists(b));
  platform::sync_folder(folder);

  const int open = platform::open_file(b, Opening::create);  // as one that an interrupt leaves
  platform::write_some(open, "half", 4);
  platform::make_empty(open);
  CHECK(platform::status_of(open)->size == 0);
  platform::remove_file(b.c_str());
  platform::close_file(open);
  CHECK(!fs::exists(b));
}

static void check_machine() {
  CHECK(platform::is_alive(platform::process_id()));
  CHECK(!platform::is_alive(0x3ffffffc));
  CHECK(!platform::machine_name().empty() && !platform::processor_name().empty());
  CHECK(platform::free_memory() > 1 << 20);
  constexpr std::size_t kBytes = std::size_t{1} << 22, kAlignment = std::size_t{1} << 21;
  void* const memory = platform::allocate_aligned(kAlignment, kBytes);
  CHECK(memory && reinterpret_cast<std::uintptr_t>(memory) % kAlignment == 0);
  if (memory) platform::prefer_large_pages(memory, kBytes);
  if (memory) std::memset(memory, 1, kBytes);
  platform::free_aligned(memory);
  CHECK(platform::is_full(ENOSPC) && !platform::is_full(EACCES) && !platform::message_of(ENOENT).empty());
}

int main() {
  const fs::path folder = fs::temp_directory_path() / ("pointfair-platform-" + std::to_string(platform::process_id()));
  fs::create_directory(folder);
  check_text_of_paths(folder);
  check_bytes(folder);
  check_offsets(folder);
  check_names(folder);
  check_machine();
  fs::remove_all(folder);
  CHECK(!fs::exists(folder));
  std::printf("%d failures on %s\n", failures, platform::processor_name().c_str());
  return failures == 0 ? 0 : 1;
}
