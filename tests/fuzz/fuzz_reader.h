// SPDX-License-Identifier: Apache-2.0
// What every fuzz target does: reads bytes as a file of one format. If that succeeds, everything that can be asked of
// the cloud is asked, and what is written is read again and must be the same.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>

#include "pointfair/file_info.hpp"
#include "pointfair/io.hpp"
#include "pointfair/normals.hpp"
#include "pointfair/texture.hpp"

namespace pointfair::fuzz {

inline void require(bool condition) {
  if (!condition) std::abort();
}

// Calls that may refuse, but with an error of this library only.
template <class Call>
bool accepted(const Call& call) {
  try {
    call();
    return true;
  } catch (const Error& error) {
    require(error.kind() == ErrorKind::file || error.kind() == ErrorKind::usage);
    return false;
  }
}

inline Cloud read_as(const std::vector<std::byte>& bytes, Format format) {
  return read(bytes, "fuzz", {.format = format, .threads = 1});
}

// A new STL file is without triangles that have an invalid corner.
inline bool has_all_points(const Cloud& again, const Cloud& cloud, Format format) {
  const bool all_finite = std::all_of(cloud.points.begin(), cloud.points.end(), is_finite);
  return again.points.size() == cloud.points.size() || (format == Format::stl && !all_finite);
}

/// Moves a point, adds an attribute, writes in every encoding, and reads that again. A text file with fewer columns in
/// some row may be refused after a column was added to it.
inline void write_changed(Cloud cloud, Format format) {
  cloud.points.front().x += 1;
  cloud.points.back().z = 7;
  Attribute added;
  added.name = "pointfair_fuzz";
  added.type = ScalarType::uint8;
  added.data.resize(cloud.points.size());
  cloud.added = {added};
  for (const Encoding encoding :
       {Encoding::ascii, Encoding::binary, Encoding::binary_big_endian, Encoding::binary_compressed}) {
    accepted([&] {
      const Cloud again = read_as(write_bytes(cloud, format, encoding), format);
      require(has_all_points(again, cloud, format));
    });
  }
  for (const Format other : {Format::ply, Format::pcd, Format::csv, Format::off, Format::obj})
    accepted([&] { write_bytes(cloud, other); });
}

inline bool same_points(const Cloud& a, const Cloud& b) {
  return a.points.size() == b.points.size() &&
         (a.points.empty() || std::memcmp(a.points.data(), b.points.data(), a.points.size() * sizeof(Point)) == 0);
}

/// Attributes have the same values one by one and all at once, or both are refused.
inline void require_same_values(const Cloud& cloud) {
  std::vector<AttributeInfo> infos;
  if (!accepted([&] { infos = attributes(cloud); })) return;  // what follows the points is damaged
  std::vector<std::string> names;
  for (const AttributeInfo& info : infos) names.push_back(info.name);
  std::vector<Attribute> each(names.size()), all;
  bool sound = true;
  for (std::size_t n = 0; n < names.size(); ++n)
    sound = accepted([&] { each[n] = attribute(cloud, names[n]); }) && sound;
  require(accepted([&] { all = attribute_values(cloud, names); }) == sound);
  for (std::size_t n = 0; sound && n < names.size(); ++n) require(each[n].data == all[n].data);
}

/// Asks for pictures, with the file itself as the library of its materials. False: the faces are damaged, or the
/// texture coordinates of the points.
inline bool has_texture_map(const Cloud& cloud, const std::vector<std::byte>& bytes) {
  return accepted([&] {
    const Texture pictures = texture(cloud, [&](const std::string&) {
      return std::string(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    });
    const TextureMap map = texture_map(cloud, pictures);
    const Polygons faces = polygons(cloud);
    require(map.pictures.size() == faces.size() && map.coordinates.size() == 2 * faces.corners.size());
    for (const std::uint32_t picture : map.pictures)
      require(picture == kNoPicture || picture < pictures.pictures.size());
  });
}

/// `same_bytes`: an unchanged cloud must be written as the bytes that it was read from; else as the same points, where
/// its points can be written at all.
inline int run(const std::vector<std::byte>& bytes, Format format, bool same_bytes = true) {
  Cloud cloud;
  if (!accepted([&] { cloud = read_as(bytes, format); })) return 0;
  require(!cloud.points.empty() && (!same_bytes || cloud.points.size() <= bytes.size() * 100));
  if (!accepted([&] { attributes(cloud); })) return 0;  // what follows the points is damaged
  require_same_values(cloud);
  const bool has_faces = accepted([&] { polygons(cloud); });
  require(accepted([&] { triangles(cloud); }) == has_faces);
  require(!has_texture_map(cloud, bytes) || has_faces);
  file_info(cloud);
  normal_attributes(cloud);
  if (same_bytes) {
    require(write_bytes(cloud, format) == bytes);
  } else {
    accepted([&] { require(same_points(read_as(write_bytes(cloud, format), format), cloud)); });
  }
  write_changed(std::move(cloud), format);
  return 0;
}
inline int run(const std::uint8_t* data, std::size_t size, Format format) {
  const auto* const begin = reinterpret_cast<const std::byte*>(data);
  return run(std::vector<std::byte>(begin, begin + size), format);
}
/// Of a format that is not written: what is read can be asked for, and written as another.
inline int run_read_only(const std::uint8_t* data, std::size_t size, Format format) {
  const auto* const begin = reinterpret_cast<const std::byte*>(data);
  Cloud cloud;
  if (!accepted([&] { cloud = read_as({begin, begin + size}, format); })) return 0;
  require(!cloud.points.empty());
  has_texture_map(cloud, {begin, begin + size});
  accepted([&] { write_bytes(cloud, Format::ply); });
  return 0;
}
inline std::vector<std::byte> as_bytes(const std::string& text) {
  const auto* const begin = reinterpret_cast<const std::byte*>(text.data());
  return {begin, begin + text.size()};
}

}  // namespace pointfair::fuzz
