// SPDX-License-Identifier: Apache-2.0
// A VPC is a STAC item collection in JSON (https://github.com/PDAL/wrench/blob/main/vpc-spec.md): each feature has an
// asset whose href is the file, relative to the VPC.
#include "survey.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>

#include "output.hpp"
#include "pointfair/io.hpp"

namespace pointfair::cli {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void fail(const fs::path& path, const std::string& message) {
  throw Error(ErrorKind::file, path.string() + ": " + message);
}

// Of a name that notes and lists have, too.
bool may_be_notes(const fs::path& path) {
  std::string extension = path.extension().string();
  std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return char(std::tolower(c)); });
  return extension == ".txt" || extension == ".csv";
}

// Leaves out what may be notes beside clouds.
void leave_notes_out(const fs::path& folder, std::vector<fs::path>& files) {
  const auto notes = std::ranges::stable_partition(files, [](const fs::path& file) { return !may_be_notes(file); });
  if (notes.empty() || notes.begin() == files.begin()) return;
  const std::string first = notes.front().filename().string();
  print_message(
      "note: {}: {} left out, since other files there are point clouds; name {} to treat {} too\n", folder.string(),
      notes.size() == 1 ? first + " is" : fmt::format("{} text files, {} the first, are", notes.size(), first),
      notes.size() == 1 ? "it" : "them", notes.size() == 1 ? "it" : "them");
  files.erase(notes.begin(), notes.end());
}

std::vector<fs::path> clouds_in(const fs::path& folder, const std::string& in_format) {
  const bool takes_floats = in_format == "kitti" || in_format == "nuscenes";
  std::vector<fs::path> files;
  bool has_floats = false, has_folders = false;
  std::error_code failed;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, failed)) {
    if (entry.path().filename().string().starts_with('.')) continue;
    has_folders = has_folders || entry.is_directory();
    if (!entry.is_regular_file()) continue;
    const bool is_floats = entry.path().extension() == ".bin";
    has_floats = has_floats || is_floats;
    if (takes_floats ? is_floats : format_of(entry.path()).has_value()) files.push_back(entry.path());
  }
  if (failed) fail(folder, "this folder cannot be read: " + failed.message());
  if (files.empty() && has_floats)
    fail(folder,
         "there are no point clouds in this folder but .bin files, which do not say what they hold: give "
         "--in-format kitti or nuscenes, and --each to run");
  if (files.empty())
    fail(folder,
         fmt::format("there are no {} in this folder{}", takes_floats ? ".bin files" : "point clouds",
                     has_folders ? ", and the folders in it are not looked into; name these" : "; name another"));
  std::ranges::sort(files);
  leave_notes_out(folder, files);
  return files;
}

// An href may be written as addresses are, "my%20tile.laz".
std::string decoded(std::string_view href) {
  std::string text;
  for (std::size_t i = 0; i < href.size(); ++i) {
    unsigned value = 0;
    const char* first = href.data() + i + 1;
    const bool is_byte =
        href[i] == '%' && i + 2 < href.size() && std::from_chars(first, first + 2, value, 16).ptr == first + 2;
    text += is_byte ? static_cast<char>(value) : href[i];
    if (is_byte) i += 2;
  }
  return text;
}

// The file that is there: pdal_wrench does not encode names, other programs do.
fs::path path_of(const std::string& href, const fs::path& vpc) {
  const auto in_folder = [&](const fs::path& path) {
    return path.is_absolute() ? path : (vpc.parent_path() / path).lexically_normal();
  };
  const fs::path written = in_folder(href), meant = in_folder(decoded(href));
  std::error_code ignored;
  return !fs::exists(written, ignored) && fs::exists(meant, ignored) ? meant : written;
}

fs::path file_of(const nlohmann::json& feature, const fs::path& vpc) {
  for (const auto& [key, asset] : feature.at("assets").items()) {
    std::string href = asset.at("href").get<std::string>();
    constexpr std::string_view kFile = "file://";
    if (href.starts_with(kFile)) href.erase(0, kFile.size());
    if (href.find("://") != std::string::npos)
      fail(vpc, "names " + href.substr(0, 100) + ", which is not on disk; fetch the files, and name the folder");
    if (!format_of(href)) continue;  // a picture, a table of statistics
    return path_of(href, vpc);
  }
  fail(vpc, "has a feature without a point cloud among its assets; make it again with pdal_wrench build_vpc");
}

std::vector<fs::path> clouds_of(const fs::path& vpc) {
  std::ifstream file(vpc, std::ios::binary);
  if (!file) fail(vpc, fmt::format("cannot open: {}", std::strerror(errno)));
  std::vector<fs::path> files;
  try {
    const nlohmann::json json = nlohmann::json::parse(file);
    for (const nlohmann::json& feature : json.at("features")) files.push_back(file_of(feature, vpc));
  } catch (const nlohmann::json::exception&) {
    fail(vpc, "is no virtual point cloud, or a damaged one; make it again with pdal_wrench build_vpc");
  }
  if (files.empty()) fail(vpc, "names no point clouds");
  return files;
}

bool is_vpc(const fs::path& path) { return path.extension() == ".vpc" || path.extension() == ".VPC"; }

}  // namespace

bool is_survey(const std::string& input) {
  std::error_code ignored;
  return is_vpc(input) || fs::is_directory(input, ignored);
}

std::string described_survey(const std::string& input, const std::string& in_format) {
  const std::size_t files = (is_vpc(input) ? clouds_of(input) : clouds_in(input, in_format)).size();
  return fmt::format("{}: is a {} of {} point cloud{}", input, is_vpc(input) ? "virtual point cloud (VPC)" : "folder",
                     files, files == 1 ? "" : "s");
}

std::vector<fs::path> files_of_survey(const std::vector<std::string>& inputs, const std::string& in_format) {
  std::vector<fs::path> files;
  for (const std::string& input : inputs) {
    if (!is_survey(input)) {
      files.emplace_back(input);
      continue;
    }
    const std::vector<fs::path> its = is_vpc(input) ? clouds_of(input) : clouds_in(input, in_format);
    files.insert(files.end(), its.begin(), its.end());
  }
  return files;
}

}  // namespace pointfair::cli
