// SPDX-License-Identifier: Apache-2.0
#include "page_files.hpp"

#include <fstream>
#include <iterator>

#include "pointfair/cloud.hpp"

namespace pointfair::viewer {
namespace {

namespace fs = std::filesystem;

std::string_view type_of(const fs::path& path) {
  constexpr std::pair<std::string_view, std::string_view> kTypes[] = {{".html", "text/html; charset=utf-8"},
                                                                      {".js", "text/javascript; charset=utf-8"},
                                                                      {".css", "text/css; charset=utf-8"},
                                                                      {".svg", "image/svg+xml"},
                                                                      {".txt", "text/plain; charset=utf-8"}};
  for (const auto& [extension, type] : kTypes)
    if (path.extension() == extension) return type;
  return "application/octet-stream";
}

}  // namespace

PageFiles read_page(const fs::path& folder) {
  PageFiles files;
  std::error_code missing;
  for (const auto& entry : fs::recursive_directory_iterator(folder, missing)) {
    if (!entry.is_regular_file()) continue;
    std::ifstream in(entry.path(), std::ios::binary);
    std::string content{std::istreambuf_iterator<char>(in), {}};
    files[fs::path("/" / entry.path().lexically_relative(folder)).generic_string()] = {type_of(entry.path()),
                                                                                       std::move(content)};
  }
  if (!files.contains("/index.html"))
    throw Error(ErrorKind::failed, "the viewer's page is not in " + folder.string() +
                                       ": install nodejs and npm, and build again with a network connection");
  return files;
}

}  // namespace pointfair::viewer
