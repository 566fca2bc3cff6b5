// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace pointfair::platform {

// Of this process.
int process_id();
// Of this machine in its network, or of a container that has process ids of its own.
std::string machine_name();
// Whether a process of this machine has that id and lives; true where the system does not say.
bool is_alive(int process);
// The processor, as its maker calls it; "CPU" where the system does not say.
std::string processor_name();

}  // namespace pointfair::platform
