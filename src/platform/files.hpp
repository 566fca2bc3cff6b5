// SPDX-License-Identifier: Apache-2.0
// What systems call differently about files. Where a call fails, errno says why.
#pragma once

#include <compare>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

namespace pointfair::platform {

// Of an open file; -1: none. Its bytes are read and written as they are.
using Descriptor = int;

enum class Opening {
  read,
  create,   // only if nothing has that name
  replace,  // a new file in place of one of that name
  device    // what is there, to be written to
};
Descriptor open_file(const std::filesystem::path& path, Opening opening);
Descriptor standard_input();
Descriptor standard_output();
// 0, or -1. A standard stream stays open.
int close_file(Descriptor file);

// How many bytes were read or written, possibly less than asked for; 0 at the end of the file; -1 where it failed. What
// a signal interrupts goes on.
std::ptrdiff_t read_some(Descriptor file, void* to, std::size_t bytes);
std::ptrdiff_t read_some_at(Descriptor file, void* to, std::size_t bytes, std::uint64_t at);
std::ptrdiff_t write_some(Descriptor file, const void* from, std::size_t bytes);

// Whether the next byte is the file's first; false for a pipe.
bool is_at_begin(Descriptor file);
bool go_to(Descriptor file, std::uint64_t at);
bool go_to_end(Descriptor file);
// Removes all that was written; where that fails, nothing happens.
void make_empty(Descriptor file);
// What was written is on the disk: 0, or -1.
int sync_file(Descriptor file);
// So are the names in a folder, where the system can say so.
void sync_folder(const std::filesystem::path& folder);

struct FileStatus {
  enum class Kind { regular, folder, other } kind = Kind::other;
  std::uint64_t size = 0;
  std::int64_t changed_seconds = 0;  // when it was last written
  std::uint32_t changed_nanoseconds = 0;
};
std::optional<FileStatus> status_of(Descriptor file);
std::optional<FileStatus> status_of(const std::filesystem::path& path);
// Gives an open file the permissions of another, if that is there.
void take_permissions(Descriptor file, const std::filesystem::path& from);

// The same for all names of one file, and for no other file that is there.
struct FileIdentity {
  std::uint64_t device = 0, number = 0;
  auto operator<=>(const FileIdentity&) const = default;
};
std::optional<FileIdentity> identity_of(const std::filesystem::path& path);

// The first `size` bytes of an open file as memory, also after the file is closed; null where it failed.
std::shared_ptr<const void> map_file(Descriptor file, std::size_t size);
// Gives memory of a mapped file back to the system, which reads it again when it is asked for. A hint.
void give_back(const void* from, std::size_t bytes);
// From now on mapped memory has small pages, so that parts of it can be given back. A hint.
void prefer_small_pages(const void* from, std::size_t bytes);

// Gives a file another name in one step: 0, or -1. The first only if nothing has that name yet.
int rename_to_free_name(const std::filesystem::path& from, const std::filesystem::path& to);
int rename_over(const std::filesystem::path& from, const std::filesystem::path& to);
// Removes a file, also an open one; a signal handler may call it.
void remove_file(const std::filesystem::path::value_type* path) noexcept;

// Whether the error says that there is no room for more bytes.
bool is_full(int error);
// What the error means, as the system says it.
std::string message_of(int error);

}  // namespace pointfair::platform
