// SPDX-License-Identifier: Apache-2.0
#include "platform/free_memory.hpp"

#ifdef __APPLE__
#include <mach/mach.h>
#include <unistd.h>
#elif !defined(__wasi__)
#include <sys/resource.h>
#endif

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace pointfair::platform {

#ifdef __APPLE__

std::uint64_t free_memory() {
  vm_statistics64 pages{};
  mach_msg_type_number_t size = HOST_VM_INFO64_COUNT;
  if (::host_statistics64(::mach_host_self(), HOST_VM_INFO64, reinterpret_cast<host_info64_t>(&pages), &size) !=
      KERN_SUCCESS)
    return std::uint64_t{8} << 30;
  // inactive pages are given back when others need them
  return (std::uint64_t{pages.free_count} + pages.inactive_count) * static_cast<std::uint64_t>(::getpagesize());
}

#elif defined(__wasi__)

// Addresses of WebAssembly have 32 bits.
std::uint64_t free_memory() { return std::uint64_t{3} << 30; }

#else

namespace fs = std::filesystem;
namespace {

constexpr std::uint64_t kNoLimit = ~std::uint64_t{0};

// What the files of a version of control groups are called.
struct GroupFiles {
  fs::path root;
  const char *limit, *used;
  std::string_view files[2];  // lines of memory.stat: pages of files, which are given back when others need them
};
const GroupFiles kVersion1{"/sys/fs/cgroup/memory",
                           "memory.limit_in_bytes",
                           "memory.usage_in_bytes",
                           {"total_inactive_file ", "total_active_file "}};
const GroupFiles kVersion2{"/sys/fs/cgroup", "memory.max", "memory.current", {"inactive_file ", "active_file "}};

std::uint64_t bytes_of_files(const fs::path& folder, const GroupFiles& names) {
  std::uint64_t bytes = 0;
  std::ifstream lines(folder / "memory.stat");
  for (std::string line; std::getline(lines, line);)
    for (const std::string_view name : names.files)
      if (line.starts_with(name)) bytes += std::strtoull(line.c_str() + name.size(), nullptr, 10);
  return bytes;
}

// What the limits of a control group, and of those that it is in, leave.
std::uint64_t free_in_group(std::string_view group, const GroupFiles& names) {
  std::uint64_t free = kNoLimit;
  // in a container the group's own folder may be the root
  for (fs::path below = fs::path(group).relative_path();; below = below.parent_path()) {
    const fs::path folder = names.root / below;
    std::uint64_t limit = 0, used = 0;
    if (std::ifstream(folder / names.limit) >> limit) {  // "max", or none
      std::ifstream(folder / names.used) >> used;
      used -= std::min(used, bytes_of_files(folder, names));
      free = std::min(free, limit > used ? limit - used : 0);
    }
    if (below.empty()) return free;
  }
}

std::uint64_t free_in_groups() {
  std::uint64_t free = kNoLimit;
  std::ifstream lines("/proc/self/cgroup");
  for (std::string line; std::getline(lines, line);) {  // number:controllers:/group
    const std::size_t controllers = line.find(':') + 1, group = line.find(':', controllers) + 1;
    if (controllers == 0 || group == 0) continue;
    const std::string_view text = line, names = text.substr(controllers, group - controllers - 1);
    const bool is_version2 = names.empty();
    if (is_version2 || names.find("memory") != names.npos)
      free = std::min(free, free_in_group(text.substr(group), is_version2 ? kVersion2 : kVersion1));
  }
  return free;
}

// What a limit of this process leaves; `used` is the name of what it limits in /proc/self/status.
std::uint64_t free_below(decltype(RLIMIT_AS) resource, const char* used) {
  rlimit limit{};
  if (::getrlimit(resource, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return kNoLimit;
  std::uint64_t bytes = 0;
  std::ifstream lines("/proc/self/status");
  for (std::string line; std::getline(lines, line);)
    if (line.starts_with(used)) bytes = std::strtoull(line.c_str() + std::string_view(used).size(), nullptr, 10) << 10;
  return limit.rlim_cur > bytes ? limit.rlim_cur - bytes : 0;
}

}  // namespace

std::uint64_t free_memory() {
  std::uint64_t free = std::uint64_t{8} << 30;
  std::ifstream lines("/proc/meminfo");
  for (std::string line; std::getline(lines, line);)
    if (line.starts_with("MemAvailable:")) free = std::strtoull(line.c_str() + 13, nullptr, 10) << 10;
  return std::min({free, free_in_groups(), free_below(RLIMIT_DATA, "VmData:"), free_below(RLIMIT_AS, "VmSize:")});
}

#endif

}  // namespace pointfair::platform
