// SPDX-License-Identifier: Apache-2.0
// The entropy coder of LAZ: adaptive arithmetic coding with 32-bit intervals, after A. Said, "Introduction to
// Arithmetic Coding: Theory and Practice" (HPL-2004-76), with the constants of the LASzip specification. A Decoder and
// an Encoder have the same calls, so that what is coded is written once for both: `code` takes the value to write, or
// ignores it, and returns the value.
#pragma once

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>

namespace pointfair::io::las {

inline constexpr std::uint32_t kLeastLength = std::uint32_t{1} << 24;  // a shorter interval takes in or gives off bytes

/// Whether no encoder writes such bytes: they name the end of the first interval, which does not belong to it. LASzip's
/// decoder reads outside its tables after them.
inline bool is_impossible_code(std::string_view code) { return code.starts_with("\xFF\xFF\xFF\xFF"); }

/// Symbols 0 to n - 1 with probabilities learnt from those seen, 2 <= n <= kMost.
template <std::uint32_t kMost>
class alignas(64) BasicSymbolModel {
 public:
  static constexpr int kShift = 15;  // a distribution has 15 bits

  explicit BasicSymbolModel(std::uint32_t symbols = kMost) : symbols_(symbols), total_(0), cycle_(symbols) {
    std::fill_n(counts_.begin(), symbols_, std::uint16_t{1});
    distribution_.fill(kBeyond);
    tops_.fill(kBeyond);
    update();
    until_update_ = cycle_ = (symbols_ + 6) >> 1;
  }

  std::uint32_t begin(std::uint32_t symbol) const { return distribution_[symbol]; }
  bool is_last(std::uint32_t symbol) const { return symbol + 1 == symbols_; }

  /// The symbol whose share of [0, 2^15) holds `value`. One pass over all places where they are few,
  /// else two over 16 places each; no branch depends on the data.
  std::uint32_t find(std::uint32_t value) const {
    const auto at = static_cast<std::uint16_t>(std::min<std::uint32_t>(value, kBeyond - 1U));
    if constexpr (kGroups <= kMostAtOnce) return count_all_up_to(at) - 1;
    std::uint32_t group = count_up_to(tops_.data(), at) - 1;
    for (std::uint32_t first = kGroup; first < tops_.size(); first += kGroup)
      group += count_up_to(tops_.data() + first, at);
    return kGroup * group + count_up_to(distribution_.data() + kGroup * group, at) - 1;
  }

  void see(std::uint32_t symbol) {
    ++counts_[symbol];
    if (--until_update_ == 0) update();
  }

 private:
  static constexpr std::uint32_t kGroup = 16, kGroups = (kMost + kGroup - 1) / kGroup,
                                 kMostCounts = std::uint32_t{1} << 15, kMostAtOnce = 3;
  static constexpr std::uint16_t kBeyond = 1U << kShift;

  // Of 16 places in ascending order.
  static std::uint32_t count_up_to(const std::uint16_t* places, std::uint16_t value) {
#ifdef __SSE2__
    const auto* const from = reinterpret_cast<const __m128i*>(places);
    const __m128i values = _mm_set1_epi16(static_cast<std::int16_t>(value)), zero = _mm_setzero_si128();
    const __m128i low = _mm_cmpeq_epi16(_mm_subs_epu16(_mm_loadu_si128(from), values), zero);
    const __m128i high = _mm_cmpeq_epi16(_mm_subs_epu16(_mm_loadu_si128(from + 1), values), zero);
    const int mask = _mm_movemask_epi8(_mm_packs_epi16(low, high));
    return static_cast<std::uint32_t>(std::countr_one(static_cast<std::uint32_t>(mask)));
#else
    std::uint32_t count = 0;
    for (std::uint32_t i = 0; i < kGroup; ++i) count += places[i] <= value;
    return count;
#endif
  }

  // Of all places at once: one pass takes less time than two that wait for each other.
  std::uint32_t count_all_up_to(std::uint16_t value) const {
#ifdef __SSE2__
    const __m128i values = _mm_set1_epi16(static_cast<std::int16_t>(value)), zero = _mm_setzero_si128();
    __m128i minus_counts = zero;
    for (std::size_t i = 0; i < distribution_.size(); i += 8) {
      const __m128i places = _mm_loadu_si128(reinterpret_cast<const __m128i*>(distribution_.data() + i));
      minus_counts = _mm_add_epi16(minus_counts, _mm_cmpeq_epi16(_mm_subs_epu16(places, values), zero));
    }
    const __m128i counts = _mm_packs_epi16(_mm_sub_epi16(zero, minus_counts), zero);
    return static_cast<std::uint32_t>(_mm_cvtsi128_si32(_mm_sad_epu8(counts, zero)));
#else
    std::uint32_t count = 0;
    for (const std::uint16_t place : distribution_) count += place <= value;
    return count;
#endif
  }

  void update() {
    total_ += cycle_;
    if (total_ > kMostCounts) {
      total_ = 0;
      for (std::uint32_t k = 0; k < symbols_; ++k) {
        counts_[k] = static_cast<std::uint16_t>((counts_[k] + 1) >> 1);
        total_ += counts_[k];
      }
    }
    const std::uint32_t scale = 0x80000000U / total_;
    std::uint32_t sum = 0;
    for (std::uint32_t k = 0; k < symbols_; ++k) {
      distribution_[k] = static_cast<std::uint16_t>((scale * sum) >> (31 - kShift));
      sum += counts_[k];
    }
    for (std::uint32_t k = 0; k < symbols_; k += kGroup) tops_[k / kGroup] = distribution_[k];
    cycle_ = std::min((5 * cycle_) >> 2, (symbols_ + 6) << 3);
    until_update_ = cycle_;
  }

  // what each symbol needs comes first, in one cache line
  std::uint32_t symbols_, until_update_, total_, cycle_;
  std::array<std::uint16_t, (kGroups + kGroup - 1) / kGroup * kGroup> tops_;  // the first of each group
  std::array<std::uint16_t, kGroups * kGroup> distribution_;                  // where each symbol's share begins
  std::array<std::uint16_t, kMost> counts_;
};

using SymbolModel = BasicSymbolModel<256>;

/// One bit with a probability learnt from those seen.
class BitModel {
 public:
  static constexpr int kShift = 13;

  std::uint32_t zero_share() const { return zero_share_; }

  void see(std::uint32_t bit) {
    zeros_ += bit == 0;
    if (--until_update_ == 0) update();
  }

 private:
  void update() {
    total_ += cycle_;
    if (total_ > std::uint32_t{1} << kShift) {
      total_ = (total_ + 1) >> 1;
      zeros_ = (zeros_ + 1) >> 1;
      if (zeros_ == total_) ++total_;
    }
    zero_share_ = (zeros_ * (0x80000000U / total_)) >> (31 - kShift);
    cycle_ = std::min<std::uint32_t>((5 * cycle_) >> 2, 64);
    until_update_ = cycle_;
  }

  std::uint32_t zeros_ = 1, total_ = 2, zero_share_ = std::uint32_t{1} << (kShift - 1), cycle_ = 4, until_update_ = 4;
};

/// Reads what an Encoder wrote. Behind the end it reads zeros; `overrun` tells.
class Decoder {
 public:
  static constexpr bool kWrites = false;

  explicit Decoder(std::string_view bytes)
      : begin_(bytes.data()), at_(bytes.data()), end_(bytes.data() + bytes.size()), value_(next_bytes()) {
    at_ += 4;
  }

  template <std::uint32_t kMost>
  std::uint32_t code(BasicSymbolModel<kMost>& model, std::uint32_t) {
    const std::uint32_t unit = length_ >> SymbolModel::kShift;
    const std::uint32_t symbol = model.find(value_ / unit);
    const std::uint32_t begin = model.begin(symbol) * unit;
    const std::uint32_t end = model.is_last(symbol) ? length_ : model.begin(symbol + 1) * unit;
    take(begin, end - begin);
    model.see(symbol);
    return symbol;
  }

  std::uint32_t code(BitModel& model, std::uint32_t) {
    const std::uint32_t zero = model.zero_share() * (length_ >> BitModel::kShift);
    const std::uint32_t bit = value_ >= zero;
    take(bit ? zero : 0, bit ? length_ - zero : zero);
    model.see(bit);
    return bit;
  }

  /// `bits` bits, each as likely as the other; 1 to 32.
  std::uint32_t code_bits(std::uint32_t bits, std::uint32_t) {
    if (bits <= kMostBits) return raw(bits);
    const std::uint32_t low = raw(16);
    return raw(bits - 16) << 16 | low;
  }

  /// More was read than there was: the bytes were no such code.
  bool overrun() const { return at_ > end_ || damaged_; }
  /// Where reading stands, in the bytes given.
  std::size_t position() const { return static_cast<std::size_t>(at_ - begin_); }

 private:
  static constexpr std::uint32_t kMostBits = 19;

  std::uint32_t raw(std::uint32_t bits) {
    const std::uint32_t unit = length_ >> bits, value = value_ / unit;
    damaged_ = damaged_ || value >> bits != 0;
    take(value * unit, unit);
    return value & ((std::uint32_t{1} << bits) - 1);
  }

  std::uint32_t next_bytes() const {
    std::uint32_t bytes = 0;
    if (end_ - at_ >= 4) {
      std::memcpy(&bytes, at_, 4);
    } else if (at_ < end_) {
      std::memcpy(&bytes, at_, static_cast<std::size_t>(end_ - at_));
    }
    return std::endian::native == std::endian::little ? __builtin_bswap32(bytes) : bytes;
  }

  void take(std::uint32_t begin, std::uint32_t length) {
    value_ -= begin;
    const auto shift = static_cast<std::uint32_t>(std::countl_zero(length | 1)) & ~7U;
    value_ = value_ << shift | static_cast<std::uint32_t>((std::uint64_t{next_bytes()} << shift) >> 32);
    length_ = length << shift;
    at_ += shift / 8;
  }

  const char *begin_, *at_, *end_;
  std::uint32_t value_, length_ = 0xFFFFFFFFU;
  bool damaged_ = false;
};

/// Appends to `to`, which is its own until `finish`.
class Encoder {
 public:
  static constexpr bool kWrites = true;

  explicit Encoder(std::string& to) : to_(to), begin_(to.size()) {
    at_ = end_ = to_.data() + begin_;
    grow();
  }

  template <std::uint32_t kMost>
  std::uint32_t code(BasicSymbolModel<kMost>& model, std::uint32_t symbol) {
    const std::uint32_t unit = length_ >> SymbolModel::kShift;
    const std::uint32_t begin = model.begin(symbol) * unit;
    const std::uint32_t end = model.is_last(symbol) ? length_ : model.begin(symbol + 1) * unit;
    give(begin, end - begin);
    model.see(symbol);
    return symbol;
  }

  std::uint32_t code(BitModel& model, std::uint32_t bit) {
    const std::uint32_t zero = model.zero_share() * (length_ >> BitModel::kShift);
    give(bit ? zero : 0, bit ? length_ - zero : zero);
    model.see(bit);
    return bit;
  }

  std::uint32_t code_bits(std::uint32_t bits, std::uint32_t value) {
    if (bits > kMostBits) {
      raw(16, value & 0xFFFF);
      raw(bits - 16, value >> 16);
    } else {
      raw(bits, value);
    }
    return value;
  }

  /// Writes what a decoder needs to read the last symbol, which ends exactly there.
  void finish() {
    const bool short_tail = length_ <= 2 * kLeastLength;
    give(short_tail ? kLeastLength >> 1 : kLeastLength, short_tail ? kLeastLength >> 9 : kLeastLength >> 1);
    to_.resize(static_cast<std::size_t>(at_ - to_.data()));
    to_.append(short_tail ? 2 : 3, '\0');
  }

 private:
  static constexpr std::uint32_t kMostBits = 19;

  void raw(std::uint32_t bits, std::uint32_t value) {
    const std::uint32_t unit = length_ >> bits;
    give(value * unit, unit);
  }

  [[gnu::always_inline]] void give(std::uint32_t begin, std::uint32_t length) {
    const std::uint32_t base = base_ + begin;
    if (base < begin) [[unlikely]]
      carry();
    const auto shift = static_cast<std::uint32_t>(std::countl_zero(length | 1)) & ~7U;
    const std::uint32_t bytes = std::endian::native == std::endian::little ? __builtin_bswap32(base) : base;
    char* const at = at_;
    at_ = at + shift / 8;
    base_ = base << shift;
    length_ = length << shift;
    std::memcpy(at, &bytes, sizeof bytes);  // of which the first stay
    if (static_cast<std::size_t>(end_ - at) < 2 * sizeof bytes) [[unlikely]]
      grow();
  }

  [[gnu::noinline]] void grow() {
    const auto at = static_cast<std::size_t>(at_ - to_.data());
    to_.resize(std::max(to_.capacity(), to_.size() + to_.size() / 2 + 64));
    at_ = to_.data() + at;
    end_ = to_.data() + to_.size();
  }

  [[gnu::noinline]] void carry() {
    char* at = at_;
    char* const begin = to_.data() + begin_;
    while (at > begin && at[-1] == '\xFF') *--at = '\0';
    if (at > begin) ++at[-1];
  }

  std::string& to_;
  std::size_t begin_;
  char *at_, *end_;
  std::uint32_t base_ = 0, length_ = 0xFFFFFFFFU;
};

}  // namespace pointfair::io::las
