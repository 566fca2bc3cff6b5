// SPDX-License-Identifier: Apache-2.0
#include "platform/process.hpp"

#include <signal.h>
#include <unistd.h>
#ifdef __APPLE__
#include <sys/sysctl.h>
#endif

#include <algorithm>
#include <array>
#include <cerrno>
#include <fstream>

namespace pointfair::platform {

int process_id() { return ::getpid(); }

// Containers may share the host's name and number their processes on their own, which Linux tells by this link.
std::string machine_name() {
  std::array<char, 256> name{}, numbers{};
  ::gethostname(name.data(), name.size() - 1);
  std::string machine = name.data();
  if (::readlink("/proc/self/ns/pid", numbers.data(), numbers.size() - 1) > 0) machine += '-';
  for (const char* at = numbers.data(); *at != '\0'; ++at)
    if (*at >= '0' && *at <= '9') machine += *at;
  return machine;
}

#ifdef __wasi__

bool is_alive(int) { return true; }

#else

bool is_alive(int process) { return ::kill(process, 0) == 0 || errno != ESRCH; }

#endif

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
