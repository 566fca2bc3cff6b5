// SPDX-License-Identifier: Apache-2.0
// Files of a work folder: written once, and there only when they are complete. The folder is on disk, or in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

namespace pointfair::scale {

using FileContent = std::vector<std::byte>;

/// A work folder in this process's memory. Its files have paths like others, and go when it goes.
class MemoryFolder {
 public:
  MemoryFolder();
  ~MemoryFolder();
  MemoryFolder(const MemoryFolder&) = delete;
  MemoryFolder& operator=(const MemoryFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// A file that gets its name, and is on the disk, once it is finished. Any number of processes may write the same one:
/// the last to finish it wins, and what they write is the same.
class NewFile {
 public:
  /// `size`: bytes that will be written, as far as known.
  explicit NewFile(const std::filesystem::path& path, std::uint64_t size = 0);
  ~NewFile();
  NewFile(const NewFile&) = delete;
  NewFile& operator=(const NewFile&) = delete;

  /// Throws Error(file); if the disk is full, with the number of bytes that are missing.
  void write(const void* data, std::size_t bytes);
  template <class T>
  void write(std::span<T> values) {
    static_assert(std::is_trivially_copyable_v<T>);
    write(values.data(), values.size_bytes());
  }
  /// `name_too`: its name is on the disk, and the names of all files of the folder that were finished before. Of a file
  /// without, the machine's end may leave nothing: it is to be made again.
  void finish(bool name_too = true);

 private:
  [[noreturn]] void fail(int error) const;

  std::filesystem::path path_, temporary_;
  std::uint64_t size_, written_ = 0;
  int fd_ = -1;
  bool is_finished_ = false;              // the file on disk has its name
  std::unique_ptr<FileContent> content_;  // of a file in memory
};

/// A finished file. Throws Error(file) if it cannot be read, or ends early.
class StoredFile {
 public:
  explicit StoredFile(const std::filesystem::path& path);
  ~StoredFile();
  StoredFile(const StoredFile&) = delete;
  StoredFile& operator=(const StoredFile&) = delete;

  void read(std::uint64_t at, void* data, std::size_t bytes) const;
  template <class T>
  void read(std::uint64_t at, std::span<T> values) const {
    static_assert(std::is_trivially_copyable_v<T>);
    read(at, values.data(), values.size_bytes());
  }
  std::uint64_t size() const;

 private:
  std::filesystem::path path_;
  int fd_ = -1;
  std::shared_ptr<const FileContent> content_;  // of a file in memory
};

/// Whether a finished file has this path; and takes it away.
bool is_stored(const std::filesystem::path& path);
void remove_stored(const std::filesystem::path& path);

/// Removes what processes of this machine that are no more left half-written in the folder.
void remove_abandoned_files(const std::filesystem::path& folder);

/// A file without content, which says by being there that something is done.
void mark(const std::filesystem::path& path);

std::string read_text(const std::filesystem::path& path);

}  // namespace pointfair::scale
