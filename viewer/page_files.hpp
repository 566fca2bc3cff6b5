// SPDX-License-Identifier: Apache-2.0
// The files of the built page, read once: what is not among them cannot be asked for.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <string_view>

namespace pointfair::viewer {

struct PageFile {
  std::string_view type;  ///< MIME
  std::string content;
};

/// By path, "/index.html", ...
using PageFiles = std::map<std::string, PageFile, std::less<>>;

/// Throws ErrorKind::failed with what to do if there is no page in the folder.
PageFiles read_page(const std::filesystem::path& folder);

}  // namespace pointfair::viewer
