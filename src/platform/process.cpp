// SPDX-License-Identifier: Apache-2.0
#include "platform/process.hpp"

#include <signal.h>

#include <cerrno>

namespace pointfair::platform {

#ifdef __wasi__

bool is_alive(int) { return true; }

#else

bool is_alive(int process) { return ::kill(process, 0) == 0 || errno != ESRCH; }

#endif

}  // namespace pointfair::platform
