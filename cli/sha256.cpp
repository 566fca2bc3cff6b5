// SPDX-License-Identifier: Apache-2.0
// SHA-256 as FIPS 180-4 has it. One function of a cryptographic library would be one more library on every platform.
#include "sha256.hpp"

#include <fmt/format.h>

#ifdef __x86_64__
#include <cpuid.h>
#include <immintrin.h>
#endif

#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <vector>

#include "pointfair/cloud.hpp"

namespace pointfair::cli {
namespace {

constexpr std::size_t kBlock = 64, kRounds = 64;
using Words = std::array<std::uint32_t, 8>;

// The first 32 bits of the fraction of a root; long double holds enough digits of it.
std::uint32_t fraction_of(long double root) {
  return static_cast<std::uint32_t>((root - std::floor(root)) * 4294967296.0L);
}

std::vector<int> first_primes(std::size_t count) {
  std::vector<int> primes;
  for (int n = 2; primes.size() < count; ++n) {
    bool is_prime = true;
    for (const int p : primes) is_prime = is_prime && n % p != 0;
    if (is_prime) primes.push_back(n);
  }
  return primes;
}

// Of the cube roots of the first 64 primes (FIPS 180-4, 4.2.2).
const std::array<std::uint32_t, kRounds>& round_constants() {
  static const auto kConstants = [] {
    std::array<std::uint32_t, kRounds> constants{};
    const std::vector<int> primes = first_primes(kRounds);
    for (std::size_t i = 0; i < kRounds; ++i)
      constants[i] = fraction_of(std::cbrt(static_cast<long double>(primes[i])));
    return constants;
  }();
  return kConstants;
}

// Of the square roots of the first eight (5.3.3).
Words first_words() {
  Words words{};
  const std::vector<int> primes = first_primes(words.size());
  for (std::size_t i = 0; i < words.size(); ++i) words[i] = fraction_of(std::sqrt(static_cast<long double>(primes[i])));
  return words;
}

void add_block(const unsigned char* block, Words& state) {
  std::array<std::uint32_t, kRounds> w{};
  for (std::size_t t = 0; t < 16; ++t)
    w[t] = std::uint32_t{block[4 * t]} << 24 | std::uint32_t{block[4 * t + 1]} << 16 |
           std::uint32_t{block[4 * t + 2]} << 8 | block[4 * t + 3];
  for (std::size_t t = 16; t < kRounds; ++t) {
    const std::uint32_t x = w[t - 15], y = w[t - 2];
    w[t] = w[t - 16] + (std::rotr(x, 7) ^ std::rotr(x, 18) ^ x >> 3) + w[t - 7] +
           (std::rotr(y, 17) ^ std::rotr(y, 19) ^ y >> 10);
  }
  const auto& constants = round_constants();
  auto [a, b, c, d, e, f, g, h] = state;
  for (std::size_t t = 0; t < kRounds; ++t) {
    const std::uint32_t first =
        h + (std::rotr(e, 6) ^ std::rotr(e, 11) ^ std::rotr(e, 25)) + ((e & f) ^ (~e & g)) + constants[t] + w[t];
    const std::uint32_t second =
        (std::rotr(a, 2) ^ std::rotr(a, 13) ^ std::rotr(a, 22)) + ((a & b) ^ (a & c) ^ (b & c));
    h = g, g = f, f = e, e = d + first, d = c, c = b, b = a, a = first + second;
  }
  const Words worked{a, b, c, d, e, f, g, h};
  for (std::size_t i = 0; i < state.size(); ++i) state[i] += worked[i];
}

#ifdef __x86_64__
bool has_instructions() {
  unsigned a = 0, b = 0, c = 0, d = 0;
  return __get_cpuid(1, &a, &b, &c, &d) && (c & bit_SSE4_1) != 0 && __get_cpuid_count(7, 0, &a, &b, &c, &d) &&
         (b & bit_SHA) != 0;
}

// The same of many blocks by instructions for it, in a tenth of the time. They hold the state as ABEF and CDGH, and do
// four rounds at a time.
__attribute__((target("sha,sse4.1"))) void add_by_instructions(const unsigned char* block, std::size_t blocks,
                                                               Words& state) {
  const auto* constants = reinterpret_cast<const __m128i*>(round_constants().data());
  auto* const words = reinterpret_cast<__m128i*>(state.data());
  const __m128i big_endian = _mm_set_epi64x(0x0c0d0e0f08090a0b, 0x0405060700010203);
  const __m128i cdab = _mm_shuffle_epi32(_mm_loadu_si128(words), 0xb1),
                efgh = _mm_shuffle_epi32(_mm_loadu_si128(words + 1), 0x1b);
  __m128i abef = _mm_alignr_epi8(cdab, efgh, 8), cdgh = _mm_blend_epi16(efgh, cdab, 0xf0);
  for (; blocks > 0; --blocks, block += kBlock) {
    const __m128i abef_before = abef, cdgh_before = cdgh;
    __m128i w[4];
    for (int i = 0; i < 4; ++i)
      w[i] = _mm_shuffle_epi8(_mm_loadu_si128(reinterpret_cast<const __m128i*>(block) + i), big_endian);
    for (int r = 0; r < 16; ++r) {
      __m128i& now = w[r % 4];
      const __m128i next = w[(r + 1) % 4], after = w[(r + 2) % 4], last = w[(r + 3) % 4];
      const __m128i summands = _mm_add_epi32(now, _mm_loadu_si128(constants + r));
      cdgh = _mm_sha256rnds2_epu32(cdgh, abef, summands);
      abef = _mm_sha256rnds2_epu32(abef, cdgh, _mm_shuffle_epi32(summands, 0x0e));
      now = _mm_add_epi32(_mm_sha256msg1_epu32(now, next), _mm_alignr_epi8(last, after, 4));
      now = _mm_sha256msg2_epu32(now, last);
    }
    abef = _mm_add_epi32(abef, abef_before);
    cdgh = _mm_add_epi32(cdgh, cdgh_before);
  }
  const __m128i feba = _mm_shuffle_epi32(abef, 0x1b), dchg = _mm_shuffle_epi32(cdgh, 0xb1);
  _mm_storeu_si128(words, _mm_blend_epi16(feba, dchg, 0xf0));
  _mm_storeu_si128(words + 1, _mm_alignr_epi8(dchg, feba, 8));
}
#endif

void add_blocks(const unsigned char* block, std::size_t blocks, Words& state) {
#ifdef __x86_64__
  static const bool kHasInstructions = has_instructions();
  if (kHasInstructions) return add_by_instructions(block, blocks, state);
#endif
  for (; blocks > 0; --blocks, block += kBlock) add_block(block, state);
}

}  // namespace

std::string sha256_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Error(ErrorKind::file, path.string() + ": cannot be read for its checksum");
  std::vector<char> buffer(std::size_t{1} << 20);
  Words state = first_words();
  std::uint64_t length = 0;
  std::size_t left = 0;
  while (file.read(buffer.data(), static_cast<std::streamsize>(buffer.size())), file.gcount() > 0) {
    left = static_cast<std::size_t>(file.gcount());
    length += left;
    add_blocks(reinterpret_cast<const unsigned char*>(buffer.data()), left / kBlock, state);
    left %= kBlock;
  }
  if (file.bad()) throw Error(ErrorKind::file, path.string() + ": cannot be read for its checksum");
  // only the last piece read may have a rest, which lies at its end
  std::vector<unsigned char> last;
  const std::size_t whole = static_cast<std::size_t>(length % buffer.size()) / kBlock * kBlock;
  for (std::size_t i = 0; i < left; ++i) last.push_back(static_cast<unsigned char>(buffer[whole + i]));
  last.push_back(0x80);
  while (last.size() % kBlock != kBlock - 8) last.push_back(0);
  for (int shift = 56; shift >= 0; shift -= 8) last.push_back(static_cast<unsigned char>(8 * length >> shift));
  // without instructions, so that one sum tests both
  for (std::size_t at = 0; at < last.size(); at += kBlock) add_block(&last[at], state);
  std::string text;
  for (const std::uint32_t word : state) text += fmt::format("{:08x}", word);
  return text;
}

}  // namespace pointfair::cli
