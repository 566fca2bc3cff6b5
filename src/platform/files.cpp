// SPDX-License-Identifier: Apache-2.0
#include "platform/files.hpp"

#include <fcntl.h>

#include <cerrno>
#include <cstdio>

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

}  // namespace

std::timespec time_of_change(const struct stat& status) {
#ifdef __APPLE__
  return status.st_mtimespec;
#else
  return status.st_mtim;
#endif
}

int rename_to_free_name(const fs::path& from, const fs::path& to) {
  const int renamed = rename_in_one_step(from.c_str(), to.c_str());
  if (renamed == 0 || errno != kUnknownToFileSystem || fs::exists(to)) return renamed;
  return ::rename(from.c_str(), to.c_str());
}

}  // namespace pointfair::platform
