// SPDX-License-Identifier: Apache-2.0
#include "io/e57/pages.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "io/file_bytes.hpp"
#include "io/parallel.hpp"
#include "io/scalar.hpp"

namespace pointfair::io::e57 {
namespace {

constexpr bool kSwapBig = !kBigEndian;  // checksums are big endian, all else little

// Eight bytes a step: table t holds the effect of a byte that t bytes follow.
using Tables = std::array<std::array<std::uint32_t, 256>, 8>;

constexpr Tables make_tables() {
  constexpr std::uint32_t kPolynomial = 0x82F63B78;  // of Castagnoli, its bits reversed
  Tables tables{};
  for (std::uint32_t byte = 0; byte < 256; ++byte) {
    std::uint32_t crc = byte;
    for (int bit = 0; bit < 8; ++bit) crc = crc >> 1 ^ ((crc & 1) != 0 ? kPolynomial : 0);
    tables[0][byte] = crc;
  }
  for (std::size_t t = 1; t < tables.size(); ++t) {
    for (std::size_t byte = 0; byte < 256; ++byte)
      tables[t][byte] = tables[t - 1][byte] >> 8 ^ tables[0][tables[t - 1][byte] & 255];
  }
  return tables;
}

constexpr Tables kTables = make_tables();

// Calls step(place in pages, bytes done before, bytes) for each run of bytes within a page.
template <class Step>
void for_each_run(std::uint64_t begin, std::uint64_t at, std::size_t size, const Step& step) {
  std::uint64_t place = at - begin;
  for (std::size_t done = 0; done < size;) {
    const std::size_t within = static_cast<std::size_t>(place % kPayload);
    const std::size_t run = std::min(size - done, kPayload - within);
    step(static_cast<std::size_t>(place / kPayload) * kPage + within, done, run);
    done += run;
    place += run;
  }
}

}  // namespace

std::uint32_t checksum(std::string_view bytes) {
  std::uint32_t crc = ~std::uint32_t{0};
  std::size_t at = 0;
  for (; at + 8 <= bytes.size(); at += 8) {
    const auto low = load<std::uint32_t>(bytes.data() + at, !kSwapBig) ^ crc;
    const auto high = load<std::uint32_t>(bytes.data() + at + 4, !kSwapBig);
    crc = kTables[7][low & 255] ^ kTables[6][low >> 8 & 255] ^ kTables[5][low >> 16 & 255] ^ kTables[4][low >> 24] ^
          kTables[3][high & 255] ^ kTables[2][high >> 8 & 255] ^ kTables[1][high >> 16 & 255] ^ kTables[0][high >> 24];
  }
  for (; at < bytes.size(); ++at) crc = crc >> 8 ^ kTables[0][(crc ^ static_cast<unsigned char>(bytes[at])) & 255];
  return ~crc;
}

void read_pages(std::string_view pages, std::uint64_t begin, std::uint64_t at, std::size_t size, char* to) {
  for_each_run(begin, at, size, [&](std::size_t place, std::size_t done, std::size_t run) {
    std::memcpy(to + done, pages.data() + place, run);
  });
}

void write_pages(std::string& pages, std::uint64_t begin, std::uint64_t at, std::size_t size, const char* from) {
  for_each_run(begin, at, size, [&](std::size_t place, std::size_t done, std::size_t run) {
    std::memcpy(pages.data() + place, from + done, run);
  });
}

void seal_pages(std::string& pages) {
  for (std::size_t at = 0; at + kPage <= pages.size(); at += kPage) {
    const std::uint32_t sum = checksum(std::string_view(pages).substr(at, kPayload));
    copy_scalar(pages.data() + at + kPayload, reinterpret_cast<const char*>(&sum), sizeof sum, kSwapBig);
  }
}

void check_pages(std::string_view file, const std::string& name) {
  constexpr std::size_t kPagesABlock = 1024;
  const std::size_t pages = file.size() / kPage;
  for_each_block((pages + kPagesABlock - 1) / kPagesABlock, [&](std::size_t block) {
    for (std::size_t p = block * kPagesABlock; p < std::min((block + 1) * kPagesABlock, pages); ++p) {
      const std::string_view page = file.substr(p * kPage, kPage);
      if (checksum(page.substr(0, kPayload)) != load<std::uint32_t>(page.data() + kPayload, kSwapBig))
        fail(name, "bytes " + std::to_string(p * kPage) + " to " + std::to_string((p + 1) * kPage) +
                       " are damaged, as their checksum says; copy the file again");
    }
  });
}

}  // namespace pointfair::io::e57
