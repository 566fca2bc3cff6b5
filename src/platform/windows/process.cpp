// SPDX-License-Identifier: Apache-2.0
#include "platform/process.hpp"

#include <windows.h>

#include <array>

namespace pointfair::platform {

int process_id() { return static_cast<int>(::GetCurrentProcessId()); }

std::string machine_name() {
  std::array<char, 256> name{};
  DWORD size = name.size() - 1;
  return ::GetComputerNameExA(ComputerNameDnsHostname, name.data(), &size) ? name.data() : "";
}

bool is_alive(int process) {
  const HANDLE handle = ::OpenProcess(SYNCHRONIZE, FALSE, static_cast<DWORD>(process));
  if (handle == nullptr) return ::GetLastError() != ERROR_INVALID_PARAMETER;
  const bool alive = ::WaitForSingleObject(handle, 0) == WAIT_TIMEOUT;
  ::CloseHandle(handle);
  return alive;
}

}  // namespace pointfair::platform
