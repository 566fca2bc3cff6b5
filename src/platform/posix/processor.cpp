// SPDX-License-Identifier: Apache-2.0
#include "platform/processor.hpp"

#ifdef __APPLE__
#include <sys/sysctl.h>
#endif

#include <algorithm>
#include <array>
#include <fstream>

namespace pointfair::platform {

#ifdef __APPLE__

std::string processor_name() {
  std::array<char, 256> name{};
  std::size_t size = name.size() - 1;
  return ::sysctlbyname("machdep.cpu.brand_string", name.data(), &size, nullptr, 0) == 0 ? name.data() : "CPU";
}

#else

std::string processor_name() {
  std::ifstream cpuinfo("/proc/cpuinfo");
  for (std::string line; std::getline(cpuinfo, line);)
    if (line.starts_with("model name")) return line.substr(std::min(line.size(), line.find(':') + 2));
  return "CPU";
}

#endif

}  // namespace pointfair::platform
