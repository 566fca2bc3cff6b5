// SPDX-License-Identifier: Apache-2.0
#include "companions.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <system_error>

namespace pointfair::viewer {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostOfName = 200;  // characters in a message

[[noreturn]] void refuse(const std::string& name, std::string_view why) {
  std::string shown = name.substr(0, kMostOfName);
  std::ranges::replace_if(
      shown, [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '?');
  throw Error(ErrorKind::file, fmt::format("{}: {}", shown, why));
}

[[noreturn]] void refuse_size(const std::string& name, std::uint64_t bytes) {
  refuse(name,
         fmt::format("has {} MiB, and up to {} are shown; make it smaller", bytes >> 20, Companions::kMostBytes >> 20));
}

// Some programs separate folders as Windows does, on every system.
std::string with_slashes(std::string name) {
  std::ranges::replace(name, '\\', '/');
  return name;
}

// A path from the folder downwards. Colons separate drives and streams of files on Windows.
fs::path checked(const std::string& name) {
  const std::u8string text(name.begin(), name.end());
  const fs::path path(text);
  const bool leads_out = name.find(':') != name.npos || name.find('\0') != name.npos || path.has_root_path() ||
                         std::ranges::find(path, fs::path("..")) != path.end();
  if (leads_out)
    refuse(name,
           "is outside of the mesh's folder, of which nothing else is read; put it there and name it without a path");
  return path;
}

bool lies_in(const fs::path& file, const fs::path& folder) {
  return std::mismatch(folder.begin(), folder.end(), file.begin(), file.end()).first == folder.end();
}

}  // namespace

Companions Companions::in_folder_of(const fs::path& mesh) {
  Companions result;
  result.folder_ = fs::absolute(mesh).parent_path();
  return result;
}

void Companions::hold(std::string bytes, const std::string& name) {
  if (bytes.size() > kMostBytes)
    throw Error(ErrorKind::usage, fmt::format("{} has {} MiB, and up to {} are shown; make the picture smaller", name,
                                              bytes.size() >> 20, kMostBytes >> 20));
  if (held_.size() >= kMostFiles || bytes.size() > kMostHeld - held_bytes_)
    throw Error(ErrorKind::usage, fmt::format("{}: up to {} files with {} MiB come with a mesh; leave some out", name,
                                              kMostFiles, kMostHeld >> 20));
  held_bytes_ += bytes.size();
  const auto [place, is_new] = held_.try_emplace(name);
  held_bytes_ -= place->second.size();
  place->second = std::move(bytes);
}

std::string Companions::read(const std::string& name) const {
  const std::string plain = with_slashes(name);
  if (folder_.empty()) {
    const auto found = held_.find(std::string_view(plain).substr(plain.rfind('/') + 1));
    if (found == held_.end()) refuse(name, "is not here; open it together with the mesh that names it");
    return found->second;
  }
  const fs::path path = checked(plain);
  std::error_code error;
  const fs::path file = fs::canonical(folder_ / path, error);
  if (error) refuse(name, "is not in the mesh's folder; put it there");
  const fs::path folder = fs::canonical(folder_, error);
  if (error || !lies_in(file, folder))
    refuse(name, "leads out of the mesh's folder, of which nothing else is read; put a copy there");
  if (!fs::is_regular_file(file, error)) refuse(name, "is no plain file; put a copy in its place");
  const std::uint64_t size = fs::file_size(file, error);
  if (error || size > kMostBytes) refuse_size(name, size);
  std::string content(static_cast<std::size_t>(size), '\0');
  std::ifstream in(file, std::ios::binary);
  in.read(content.data(), static_cast<std::streamsize>(content.size()));
  if (static_cast<std::uint64_t>(in.gcount()) != size) refuse(name, "cannot be read; check who may read it");
  return content;
}

std::string_view picture_type(std::string_view bytes) {
  if (bytes.starts_with("\x89PNG\r\n\x1a\n")) return "image/png";
  if (bytes.starts_with("\xff\xd8\xff")) return "image/jpeg";
  if (bytes.starts_with("RIFF") && bytes.substr(8).starts_with("WEBP") && bytes.size() > 12) return "image/webp";
  return {};
}

std::string picture_bytes(const TexturePicture& picture, const Companions& companions) {
  std::string bytes(reinterpret_cast<const char*>(picture.bytes.data()), picture.bytes.size());
  if (bytes.empty()) bytes = companions.read(picture.name);
  if (bytes.size() > Companions::kMostBytes) refuse_size(picture.name, bytes.size());
  if (picture_type(bytes).empty()) refuse(picture.name, "is no PNG, JPEG or WebP picture; convert it to one of these");
  return bytes;
}

}  // namespace pointfair::viewer
