// SPDX-License-Identifier: Apache-2.0
// In place of laszip_codec.cpp in a build without LASzip.
#include <cstdlib>

#include "io/las/laszip_codec.hpp"

namespace pointfair::io::las {

bool has_laszip() { return false; }

bool laszip_decode(const Compression&, std::string_view, std::uint32_t, std::uint32_t, std::span<char>) {
  std::abort();
}

void laszip_encode(const Compression&, std::span<const char>, std::string&) { std::abort(); }

}  // namespace pointfair::io::las
