// SPDX-License-Identifier: Apache-2.0
// The bytes of a whole file, immutable: mapped where the file is a regular one, else owned.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace pointfair::io {

/// Throws Error(file) with "name: message".
[[noreturn]] void fail(const std::string& name, const std::string& message);

/// Refuses a file that promises `points` beside `others`, of `bytes` bytes each in memory, where these need not be in
/// the file: more than 16 MiB, and more than 256 times the file, is what only a file made to do harm promises.
void check_plausible(std::uint64_t points, std::uint64_t others, std::size_t bytes, std::size_t file_size,
                     const std::string& name);

/// The bytes of one file. Copies share them. A mapped file stays readable after it was unlinked or replaced.
class FileBytes {
 public:
  /// Reads the file; "-" is standard input. Throws Error(file) with the path.
  static FileBytes open(const std::filesystem::path& path);
  static FileBytes copy(std::span<const std::byte> bytes);

  std::string_view view() const { return view_; }
  /// Gives the memory of a mapped file back to the system, which reads it again when it is asked for: from now on in
  /// small pages, so that release() is worth something.
  void release_all() const;
  /// The same of a part.
  void release(std::string_view part) const;

 private:
  FileBytes(std::shared_ptr<const void> owner, std::string_view view, bool is_mapped = false)
      : owner_(std::move(owner)), view_(view), is_mapped_(is_mapped) {}

  std::shared_ptr<const void> owner_;
  std::string_view view_;
  bool is_mapped_ = false;
};

/// How a path is named in messages: as given, "-" as "standard input" or "standard output".
std::string shown_name(const std::filesystem::path& path, bool input);

}  // namespace pointfair::io
