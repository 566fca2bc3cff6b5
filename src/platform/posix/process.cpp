// SPDX-License-Identifier: Apache-2.0
#include "platform/process.hpp"

#include <signal.h>
#include <unistd.h>

#include <array>
#include <cerrno>

namespace pointfair::platform {

int process_id() { return ::getpid(); }

std::string machine_name() {
  std::array<char, 256> name{};
  ::gethostname(name.data(), name.size() - 1);
  return name.data();
}

#ifdef __wasi__

bool is_alive(int) { return true; }

#else

bool is_alive(int process) { return ::kill(process, 0) == 0 || errno != ESRCH; }

#endif

}  // namespace pointfair::platform
