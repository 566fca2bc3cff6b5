// SPDX-License-Identifier: Apache-2.0
// The files that a mesh names: libraries of materials and pictures.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>

#include "pointfair/texture.hpp"

namespace pointfair::viewer {

/// They are read from the mesh's own folder, or are those that came through the page together with it. A mesh is made
/// by whoever sent it, so nothing outside of that folder can be named: no absolute path, no way up, no link that leads
/// out, and only plain files.
class Companions {
 public:
  static constexpr std::uint64_t kMostBytes = std::uint64_t{64} << 20;  ///< of a file
  static constexpr std::uint64_t kMostHeld = std::uint64_t{256} << 20;  ///< of all that came through the page
  static constexpr std::size_t kMostFiles = 256;                        ///< that came through the page

  /// None.
  Companions() = default;
  /// Those in the folder of `mesh`.
  static Companions in_folder_of(const std::filesystem::path& mesh);

  /// Holds one that came through the page. Throws ErrorKind::usage where it is too large, or there are too many.
  void hold(std::string bytes, const std::string& name);

  /// The content of the file that a mesh calls `name`. Those that came through the page go by the last part of the
  /// name, for a browser says no folders. Throws ErrorKind::file with a line that says why there is none.
  std::string read(const std::string& name) const;

 private:
  std::filesystem::path folder_;  // empty: they came through the page
  std::map<std::string, std::string, std::less<>> held_;
  std::uint64_t held_bytes_ = 0;
};

/// The MIME type of a picture that browsers draw (PNG, JPEG or WebP), by its first bytes; empty for anything else.
std::string_view picture_type(std::string_view bytes);

/// The bytes of a picture: those that the mesh's file holds, or those of the file that it names. Throws ErrorKind::file
/// with a line that says why there are none, or that they are no picture that browsers draw.
std::string picture_bytes(const TexturePicture& picture, const Companions& companions);

}  // namespace pointfair::viewer
