// SPDX-License-Identifier: Apache-2.0
// Paths as text, which is UTF-8 here. path::string() would ask Windows for the code page of the user, which lacks most
// characters.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace pointfair::platform {

inline std::string text_of(const std::filesystem::path& path) {
  const auto text = path.u8string();
  return {text.begin(), text.end()};
}
inline std::filesystem::path path_of(std::string_view text) {
  return std::filesystem::path(std::u8string(text.begin(), text.end()));
}

}  // namespace pointfair::platform
