// SPDX-License-Identifier: Apache-2.0
#include "scale/free_memory.hpp"

#include <sys/resource.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace pointfair::scale {
namespace {

// What the memory limit of this process's control group leaves (cgroup v2).
std::uint64_t free_in_group() {
  constexpr std::uint64_t kNoLimit = ~std::uint64_t{0};
  std::string group;
  for (std::ifstream lines("/proc/self/cgroup"); std::getline(lines, group);)
    if (group.starts_with("0::")) break;
  if (!group.starts_with("0::")) return kNoLimit;
  const std::filesystem::path folder = "/sys/fs/cgroup" + group.substr(3);
  std::uint64_t limit = 0, used = 0;
  if (!(std::ifstream(folder / "memory.max") >> limit)) return kNoLimit;  // "max", or none
  std::ifstream(folder / "memory.current") >> used;
  return limit > used ? limit - used : 0;
}

// What a limit of this process leaves; `used` is the name of what it limits in /proc/self/status.
std::uint64_t free_below(int resource, const char* used) {
  rlimit limit{};
  if (::getrlimit(static_cast<__rlimit_resource_t>(resource), &limit) != 0 || limit.rlim_cur == RLIM_INFINITY)
    return ~std::uint64_t{0};
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
  return std::min({free, free_in_group(), free_below(RLIMIT_DATA, "VmData:"), free_below(RLIMIT_AS, "VmSize:")});
}

}  // namespace pointfair::scale
