// SPDX-License-Identifier: Apache-2.0
#include "platform/free_memory.hpp"

#include <windows.h>

#include <algorithm>

namespace pointfair::platform {
namespace {

constexpr std::uint64_t kNoLimit = ~std::uint64_t{0};

// What the limits of the job that this process is in, as of a container, leave.
std::uint64_t free_in_job() {
  JOBOBJECT_EXTENDED_LIMIT_INFORMATION job{};
  if (!::QueryInformationJobObject(nullptr, JobObjectExtendedLimitInformation, &job, sizeof job, nullptr))
    return kNoLimit;
  const DWORD flags = job.BasicLimitInformation.LimitFlags;
  std::uint64_t free = kNoLimit;
  if ((flags & JOB_OBJECT_LIMIT_PROCESS_MEMORY) != 0) free = job.ProcessMemoryLimit;
  if ((flags & JOB_OBJECT_LIMIT_JOB_MEMORY) != 0) free = std::min<std::uint64_t>(free, job.JobMemoryLimit);
  return free;
}

}  // namespace

std::uint64_t free_memory() {
  MEMORYSTATUSEX memory{};
  memory.dwLength = sizeof memory;
  if (!::GlobalMemoryStatusEx(&memory)) return std::uint64_t{8} << 30;
  return std::min({std::uint64_t{memory.ullAvailPhys}, std::uint64_t{memory.ullAvailPageFile}, free_in_job()});
}

}  // namespace pointfair::platform
