// SPDX-License-Identifier: Apache-2.0
// The order in which the page holds points: steps of about n / golden ratio through the file. Any first part of it is
// spread evenly over the file, so the page draws less by drawing a prefix, and a prefix is what it gets of a cloud that
// is too large for it. A formula both ways, so it takes no memory.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <utility>

namespace pointfair::viewer {

class Order {
 public:
  /// Of n points, n < 2^32.
  explicit Order(std::uint64_t n = 0) : n_(n) {
    if (n < 3) return;
    stride_ = static_cast<std::uint64_t>(std::llround(static_cast<double>(n) / std::numbers::phi));
    while (std::gcd(stride_, n) != 1) ++stride_;
    inverse_ = inverse_of(stride_, n);
  }

  std::uint64_t size() const { return n_; }
  /// The index in the file of the point at `place`.
  std::uint32_t index(std::uint64_t place) const { return static_cast<std::uint32_t>(place * stride_ % n_); }
  /// The index at the place after that of `index`, without a division.
  std::uint32_t next(std::uint32_t index) const {
    const std::uint64_t following = index + stride_;
    return static_cast<std::uint32_t>(following >= n_ ? following - n_ : following);
  }
  /// The place of the point that has `index` in the file.
  std::uint32_t place(std::uint64_t index) const { return static_cast<std::uint32_t>(index * inverse_ % n_); }

 private:
  // x with a x = 1 modulo n, by Euclid.
  static std::uint64_t inverse_of(std::uint64_t a, std::uint64_t n) {
    std::int64_t x = 0, next_x = 1, r = static_cast<std::int64_t>(n), next_r = static_cast<std::int64_t>(a);
    while (next_r != 0) {
      const std::int64_t quotient = r / next_r;
      x = std::exchange(next_x, x - quotient * next_x);
      r = std::exchange(next_r, r - quotient * next_r);
    }
    return static_cast<std::uint64_t>(x < 0 ? x + static_cast<std::int64_t>(n) : x);
  }

  std::uint64_t n_ = 0, stride_ = 1, inverse_ = 1;
};

}  // namespace pointfair::viewer
