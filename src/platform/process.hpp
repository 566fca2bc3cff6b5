// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace pointfair::platform {

// Whether a process of this machine has that id and lives; true where the system does not say.
bool is_alive(int process);

}  // namespace pointfair::platform
