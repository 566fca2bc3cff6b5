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

std::string processor_name() {
  constexpr const wchar_t* kKey = L"HARDWARE\\DESCRIPTION\\System\\CentralProcessor\\0";
  std::array<wchar_t, 256> name{};
  DWORD size = (name.size() - 1) * sizeof(wchar_t);
  if (::RegGetValueW(HKEY_LOCAL_MACHINE, kKey, L"ProcessorNameString", RRF_RT_REG_SZ, nullptr, name.data(), &size) !=
      ERROR_SUCCESS)
    return "CPU";
  std::string plain;  // it is ASCII
  for (const wchar_t* at = name.data(); *at != 0; ++at) plain += static_cast<char>(*at);
  while (plain.ends_with(' ')) plain.pop_back();
  return plain.empty() ? "CPU" : plain;
}

}  // namespace pointfair::platform
