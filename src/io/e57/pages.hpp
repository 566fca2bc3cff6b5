// SPDX-License-Identifier: Apache-2.0
// The bytes of an E57 file: pages of 1,024 bytes, of which the last four are a CRC-32C of the others. Places in the
// file are physical; what is stored counts logical bytes, without the checksums.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace pointfair::io::e57 {

inline constexpr std::size_t kPage = 1024, kPayload = 1020;

constexpr std::uint64_t to_logical(std::uint64_t physical) { return physical / kPage * kPayload + physical % kPage; }
constexpr std::uint64_t to_physical(std::uint64_t logical) { return logical / kPayload * kPage + logical % kPayload; }

/// CRC-32C (Castagnoli) of the bytes.
std::uint32_t checksum(std::string_view bytes);

/// Copies `size` logical bytes from `at` on out of pages that begin at the logical place `begin`.
void read_pages(std::string_view pages, std::uint64_t begin, std::uint64_t at, std::size_t size, char* to);
/// The other way round; checksums are not touched.
void write_pages(std::string& pages, std::uint64_t begin, std::uint64_t at, std::size_t size, const char* from);

/// Renews the checksum of each page.
void seal_pages(std::string& pages);

/// Throws Error(file) for the first page whose checksum is wrong. In parallel.
void check_pages(std::string_view file, const std::string& name);

}  // namespace pointfair::io::e57
