// SPDX-License-Identifier: Apache-2.0
// Files are opened so that they can be renamed and removed while they are open, as elsewhere.
#include "platform/files.hpp"

#include <windows.h>
// after it
#include <fcntl.h>
#include <io.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <system_error>

namespace pointfair::platform {
namespace fs = std::filesystem;
namespace {

int errno_of(DWORD error) {
  switch (error) {
    case ERROR_FILE_NOT_FOUND:
    case ERROR_PATH_NOT_FOUND:
    case ERROR_INVALID_NAME:
    case ERROR_BAD_NETPATH:
      return ENOENT;
    case ERROR_ACCESS_DENIED:
    case ERROR_SHARING_VIOLATION:
    case ERROR_LOCK_VIOLATION:
    case ERROR_USER_MAPPED_FILE:
    case ERROR_WRITE_PROTECT:
      return EACCES;
    case ERROR_FILE_EXISTS:
    case ERROR_ALREADY_EXISTS:
      return EEXIST;
    case ERROR_DISK_FULL:
    case ERROR_HANDLE_DISK_FULL:
      return ENOSPC;
    case ERROR_BROKEN_PIPE:
    case ERROR_NO_DATA:
      return EPIPE;
    case ERROR_NOT_ENOUGH_MEMORY:
    case ERROR_OUTOFMEMORY:
    case ERROR_COMMITMENT_LIMIT:
      return ENOMEM;
    case ERROR_TOO_MANY_OPEN_FILES:
      return EMFILE;
    default:
      return EIO;
  }
}
int fail() {
  errno = errno_of(::GetLastError());
  return -1;
}

HANDLE handle_of(Descriptor file) { return reinterpret_cast<HANDLE>(::_get_osfhandle(file)); }

// A system's own handle, which is closed.
class Handle {
 public:
  explicit Handle(HANDLE handle) : handle_(handle) {}
  ~Handle() {
    if (is_valid()) ::CloseHandle(handle_);
  }
  Handle(const Handle&) = delete;
  Handle& operator=(const Handle&) = delete;
  bool is_valid() const { return handle_ != nullptr && handle_ != INVALID_HANDLE_VALUE; }
  HANDLE get() const { return handle_; }

 private:
  HANDLE handle_;
};

constexpr DWORD kShared = FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE;

std::uint64_t together(DWORD high, DWORD low) { return std::uint64_t{high} << 32 | low; }

FileStatus status_of_handle(HANDLE handle) {
  FileStatus status;
  BY_HANDLE_FILE_INFORMATION information{};
  if (::GetFileType(handle) != FILE_TYPE_DISK || !::GetFileInformationByHandle(handle, &information)) return status;
  const bool is_folder = (information.dwFileAttributes & FILE_ATTRIBUTE_DIRECTORY) != 0;
  status.kind = is_folder ? FileStatus::Kind::folder : FileStatus::Kind::regular;
  status.size = together(information.nFileSizeHigh, information.nFileSizeLow);
  // in steps of 100 ns since 1601
  constexpr std::uint64_t kSecond = 10'000'000, kYears1601To1970 = 11'644'473'600;
  const std::uint64_t changed =
      together(information.ftLastWriteTime.dwHighDateTime, information.ftLastWriteTime.dwLowDateTime);
  status.changed_seconds = static_cast<std::int64_t>(changed / kSecond) - static_cast<std::int64_t>(kYears1601To1970);
  status.changed_nanoseconds = static_cast<std::uint32_t>(changed % kSecond * 100);
  return status;
}

// For what is known of a file, be it a folder.
HANDLE open_for_status(const fs::path& path) {
  return ::CreateFileW(path.c_str(), FILE_READ_ATTRIBUTES, kShared, nullptr, OPEN_EXISTING, FILE_FLAG_BACKUP_SEMANTICS,
                       nullptr);
}

// The calls of the C library take no more at a time.
unsigned part_of(std::size_t bytes) { return static_cast<unsigned>(std::min<std::size_t>(bytes, INT_MAX)); }

int rename(const fs::path& from, const fs::path& to, DWORD flags) {
  return ::MoveFileExW(from.c_str(), to.c_str(), flags) ? 0 : fail();
}

}  // namespace

Descriptor open_file(const fs::path& path, Opening opening) {
  const bool reads = opening == Opening::read;
  const DWORD how = opening == Opening::create    ? CREATE_NEW
                    : opening == Opening::replace ? CREATE_ALWAYS
                                                  : OPEN_EXISTING;
  // without this flag a folder is refused by a message that names rights
  const DWORD flags = reads ? FILE_ATTRIBUTE_NORMAL | FILE_FLAG_BACKUP_SEMANTICS : FILE_ATTRIBUTE_NORMAL;
  const DWORD rights = reads ? GENERIC_READ : opening == Opening::device ? GENERIC_WRITE : GENERIC_WRITE | DELETE;
  HANDLE handle = ::CreateFileW(path.c_str(), rights, kShared, nullptr, how, flags, nullptr);
  if (handle == INVALID_HANDLE_VALUE) return fail();
  const int file = ::_open_osfhandle(reinterpret_cast<std::intptr_t>(handle), (reads ? _O_RDONLY : 0) | _O_BINARY);
  if (file < 0) ::CloseHandle(handle);
  return file;
}
Descriptor standard_input() {
  ::_setmode(0, _O_BINARY);
  return 0;
}
Descriptor standard_output() {
  ::_setmode(1, _O_BINARY);
  return 1;
}
int close_file(Descriptor file) { return file > 2 ? ::_close(file) : 0; }

std::ptrdiff_t read_some(Descriptor file, void* to, std::size_t bytes) { return ::_read(file, to, part_of(bytes)); }
std::ptrdiff_t read_some_at(Descriptor file, void* to, std::size_t bytes, std::uint64_t at) {
  OVERLAPPED where{};
  where.Offset = static_cast<DWORD>(at);
  where.OffsetHigh = static_cast<DWORD>(at >> 32);
  DWORD got = 0;
  if (::ReadFile(handle_of(file), to, part_of(bytes), &got, &where)) return got;
  return ::GetLastError() == ERROR_HANDLE_EOF ? 0 : fail();
}
std::ptrdiff_t write_some(Descriptor file, const void* from, std::size_t bytes) {
  return ::_write(file, from, part_of(bytes));
}

bool is_at_begin(Descriptor file) {
  return ::GetFileType(handle_of(file)) == FILE_TYPE_DISK && ::_lseeki64(file, 0, SEEK_CUR) == 0;
}
bool go_to(Descriptor file, std::uint64_t at) {
  return ::_lseeki64(file, static_cast<std::int64_t>(at), SEEK_SET) >= 0;
}
bool go_to_end(Descriptor file) { return ::_lseeki64(file, 0, SEEK_END) >= 0; }
void make_empty(Descriptor file) { (void)::_chsize_s(file, 0); }
int sync_file(Descriptor file) { return ::_commit(file); }
void sync_folder(const fs::path&) {}

std::optional<FileStatus> status_of(Descriptor file) {
  const HANDLE handle = handle_of(file);
  if (handle == INVALID_HANDLE_VALUE) return std::nullopt;
  return status_of_handle(handle);
}
std::optional<FileStatus> status_of(const fs::path& path) {
  const Handle handle(open_for_status(path));
  if (!handle.is_valid()) {
    fail();
    return std::nullopt;
  }
  return status_of_handle(handle.get());
}
void take_permissions(Descriptor, const fs::path&) {}  // a new file has those of its folder

std::optional<FileIdentity> identity_of(const fs::path& path) {
  const Handle handle(open_for_status(path));
  BY_HANDLE_FILE_INFORMATION information{};
  if (!handle.is_valid() || !::GetFileInformationByHandle(handle.get(), &information)) return std::nullopt;
  return FileIdentity{information.dwVolumeSerialNumber,
                      together(information.nFileIndexHigh, information.nFileIndexLow)};
}

std::shared_ptr<const void> map_file(Descriptor file, std::size_t size) {
  const Handle mapping(::CreateFileMappingW(handle_of(file), nullptr, PAGE_READONLY, 0, 0, nullptr));
  const void* const start = mapping.is_valid() ? ::MapViewOfFile(mapping.get(), FILE_MAP_READ, 0, 0, size) : nullptr;
  if (start == nullptr) {
    fail();
    return nullptr;
  }
  return {start, [](const void* from) { ::UnmapViewOfFile(from); }};
}
// Of pages that nobody locked, it takes them out of what the process holds.
void give_back(const void* from, std::size_t bytes) { ::VirtualUnlock(const_cast<void*>(from), bytes); }
void prefer_small_pages(const void*, std::size_t) {}

int rename_to_free_name(const fs::path& from, const fs::path& to) { return rename(from, to, 0); }
int rename_over(const fs::path& from, const fs::path& to) { return rename(from, to, MOVEFILE_REPLACE_EXISTING); }
void remove_file(const wchar_t* path) noexcept { ::DeleteFileW(path); }

bool is_full(int error) { return error == ENOSPC; }
std::string message_of(int error) { return std::generic_category().message(error); }

}  // namespace pointfair::platform
