// SPDX-License-Identifier: Apache-2.0
#include "platform/processor.hpp"

#include <windows.h>

#include <array>

namespace pointfair::platform {

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
