// SPDX-License-Identifier: Apache-2.0
#include "platform/process.hpp"

#include <signal.h>
#include <unistd.h>

#include <array>
#include <cerrno>

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

}  // namespace pointfair::platform
