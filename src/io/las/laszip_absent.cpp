// SPDX-License-Identifier: Apache-2.0
// In place of laszip_codec.cpp in a build without LASzip.
#include "io/las/codec.hpp"
#include "pointfair/cloud.hpp"

namespace pointfair::io::las {
namespace {

[[noreturn]] void fail_absent() {
  throw Error(
      ErrorKind::file,
      "this build has no LASzip, so LAZ files cannot be read or written; use LAS, or build with POINTFAIR_LAS=ON");
}

}  // namespace

bool has_laszip() { return false; }

bool decode_chunk(const Compression&, std::string_view, std::uint32_t, std::uint32_t, std::span<char>) {
  fail_absent();
}

void encode_chunk(const Compression&, std::span<const char>, std::string&) { fail_absent(); }

}  // namespace pointfair::io::las
