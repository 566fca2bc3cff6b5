// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "io_files.h"

namespace pointfair::test {

/// A GLB file of this JSON and this buffer.
inline std::string glb(std::string json, std::string binary) {
  json.resize((json.size() + 3) / 4 * 4, ' ');
  binary.resize((binary.size() + 3) / 4 * 4);
  const auto number = [](std::size_t value) { return packed<std::uint32_t>({static_cast<std::uint32_t>(value)}); };
  return "glTF" + number(2) + number(28 + json.size() + binary.size()) + number(json.size()) + "JSON" + json +
         number(binary.size()) + std::string("BIN\0", 4) + binary;
}

}  // namespace pointfair::test
