// SPDX-License-Identifier: Apache-2.0
#include "portable.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>

namespace pointfair::portable {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// high + low, of twice the precision; |low| is at most half a last place of high.
struct Pair {
  double high, low;
};

// Exact (Dekker 1971): sums of |a| >= |b|, and products below 2^996.
Pair sum(double a, double b) {
  const double high = a + b;
  return {high, b - (high - a)};
}
Pair product(double a, double b) {
  constexpr double kSplit = 0x1p27 + 1;  // halves of 26 bits
  const double at = kSplit * a, bt = kSplit * b;
  const double ah = at - (at - a), al = a - ah, bh = bt - (bt - b), bl = b - bh;
  const double high = a * b;
  return {high, ((ah * bh - high) + ah * bl + al * bh) + al * bl};
}

// log(x) to about 2^-58 of it, of a positive finite x = 2^e m, as e log(2) + 2 artanh((m - 1) / (m + 1)).
Pair log_pair(double x) {
  int e = 0;
  double m = std::frexp(x, &e);
  if (m < std::numbers::sqrt2 / 2) m *= 2, --e;
  const double f = m - 1;
  const Pair divisor = sum(m < 1 ? 1.0 : m, m < 1 ? m : 1.0);
  const double s = f / divisor.high;
  const Pair back = product(s, divisor.high);
  const double s_low = (((f - back.high) - back.low) - s * divisor.low) / divisor.high;
  const double square = s * s;  // at most 0.0295
  double series = 0;            // of 2 artanh(s) / s - 2; the first term left out is 2e-19
  for (int odd = 23; odd >= 3; odd -= 2) series = (series + 2.0 / odd) * square;
  constexpr double kLog2High = 0x1.62e42fee00000p-1, kLog2Low = 0x1.a39ef35793c76p-33;  // e times the first is exact
  const double low = 2 * s_low + s * series + e * kLog2Low;
  if (e == 0) return sum(2 * s, low);
  const Pair high = sum(e * kLog2High, 2 * s);
  return sum(high.high, high.low + low);
}

// atan(t) for 0 <= t <= 1 / 16: the first term left out is 3e-18 of it.
double small_atan(double t) {
  const double square = t * t;
  double series = 0;
  for (int odd = 13; odd >= 3; odd -= 2) series = square * (((odd / 2) % 2 == 0 ? 1.0 : -1.0) / odd + series);
  return t + t * series;
}

// atan(y / x) for 0 <= y <= x, x > 0; NaN if one of them is.
double first_octant(double y, double x) {
  static constexpr std::array kTable{// atan(n / 16)
                                     0.0,
                                     0.06241880999595735,
                                     0.12435499454676144,
                                     0.18534794999569476,
                                     0.24497866312686414,
                                     0.3028848683749714,
                                     0.35877067027057225,
                                     0.4124104415973873,
                                     0.4636476090008061,
                                     0.5123894603107377,
                                     0.5585993153435624,
                                     0.6022873461349642,
                                     0.6435011087932844,
                                     0.6823165548747481,
                                     0.7188299996216245,
                                     0.7531512809621944,
                                     0.7853981633974483};
  const double ratio = y == x ? 1 : y / x;  // of infinite ones too
  if (ratio != ratio) return ratio;
  const int n = int(ratio * 16);
  if (n == 0) return small_atan(ratio);
  const double middle = n / 16.0;
  return kTable[std::size_t(n)] + small_atan((ratio - middle) / (1 + ratio * middle));
}

// x less the nearest multiple of pi / 2, and that multiple modulo 4; NaN unless x is finite.
struct Turn {
  Pair rest;
  int quarter;
};
Turn turn_of(double x) {
  if (!std::isfinite(x)) return {{kNaN, kNaN}, 0};
  // 33 bits each, so that n times the first is exact
  constexpr double kFirst = 0x1.921fb54400000p+0, kSecond = 0x1.0b4611a600000p-34, kThird = 0x1.3198a2e037073p-69;
  if (!(std::abs(x) < 1e5)) x = std::fmod(x, 2 * std::numbers::pi);
  const double n = std::nearbyint(x * (2 / std::numbers::pi));
  const double first = x - n * kFirst, second = n * kSecond, high = first - second;
  const double low = ((first - high) - second) - n * kThird;
  const double rest = high + low;
  return {{rest, (high - rest) + low}, int(std::int64_t(n) & 3)};
}

double sin_of(const Pair& r) {
  const double square = r.high * r.high;
  double series = 0, factorial = 355687428096000;  // 17!
  for (int n = 17; n >= 3; n -= 2) {
    series = square * ((n / 2 % 2 == 0 ? 1.0 : -1.0) / factorial + series);
    factorial /= n * (n - 1);
  }
  return r.high + (r.high * series + r.low * (1 - square / 2));
}

double cos_of(const Pair& r) {
  const double square = r.high * r.high, half = square / 2;
  double series = 0, factorial = 6402373705728000;  // 18!
  for (int n = 18; n >= 4; n -= 2) {
    series = square * ((n / 2 % 2 == 0 ? 1.0 : -1.0) / factorial + series);
    factorial /= n * (n - 1);
  }
  const double high = 1 - half;
  return high + (((1 - high) - half) + (square * series - r.high * r.low));
}

}  // namespace

double exp(double x) { return point::exponential(x); }

double log(double x) {
  if (x == 0) return -kInfinite;
  if (!(x > 0)) return kNaN;
  return x < kInfinite ? log_pair(x).high : x;
}

double log1p(double x) {
  const double whole = 1 + x;  // off by rounding, which the second term makes up for
  if (!(whole > 0 && whole < kInfinite)) return log(whole);
  return log(whole) + (x - (whole - 1)) / whole;
}

double pow(double x, double y) {
  if (y == 0) return 1;
  if (x == 0) return y > 0 ? 0 : kInfinite;
  if (!(x > 0)) return kNaN;
  if (!(x < kInfinite)) return y > 0 ? x : 0;
  const Pair logarithm = log_pair(x), power = product(logarithm.high, y);
  if (!(std::abs(power.high) < 700)) return exp(power.high);
  const double whole = exp_within_700(power.high);
  return whole + whole * (power.low + logarithm.low * y);
}

double power_of_ten(int n) {
  constexpr int kExact = 22;
  constexpr double kLargest = 1e22;
  double power = 1;
  int left = std::abs(n);
  for (; left > kExact; left -= kExact) power *= kLargest;
  double rest = 1;
  while (left-- > 0) rest *= 10;
  power *= rest;
  return n < 0 ? 1 / power : power;
}

int decimal_exponent(double x) {
  int n = int(std::floor(log(x) / std::numbers::ln10));
  while (power_of_ten(n) > x) --n;
  while (power_of_ten(n + 1) <= x) ++n;
  return n;
}

double power_of_two_below(double x) {
  if (!(x > 0 && x < kInfinite)) return x;
  int exponent = 0;
  std::frexp(x, &exponent);
  return std::ldexp(1, exponent - 1);
}

double power_of_two_above(double x) {
  const double below = power_of_two_below(x);
  return below < x ? 2 * below : below;
}

double hypot(double x, double y) { return hypot(x, y, 0); }

double hypot(double x, double y, double z) {
  const double squares = x * x + y * y + z * z;
  if (squares > 1e-250 && squares < 1e250) return std::sqrt(squares);
  const double most = std::max({std::abs(x), std::abs(y), std::abs(z)});
  if (!(most > 0 && most < kInfinite)) return std::sqrt(squares);
  const double a = x / most, b = y / most, c = z / most;
  return most * std::sqrt(a * a + b * b + c * c);
}

double sin(double x) {
  const Turn turn = turn_of(x);
  const double value = turn.quarter % 2 == 0 ? sin_of(turn.rest) : cos_of(turn.rest);
  return turn.quarter < 2 ? value : -value;
}

double cos(double x) {
  const Turn turn = turn_of(x);
  const double value = turn.quarter % 2 == 0 ? cos_of(turn.rest) : sin_of(turn.rest);
  return turn.quarter == 0 || turn.quarter == 3 ? value : -value;
}

double atan2(double y, double x) {
  const double up = std::abs(y), along = std::abs(x);
  if (up == 0 && x == x) return std::signbit(x) ? std::copysign(std::numbers::pi, y) : y;
  constexpr double kHalfPi = std::numbers::pi / 2, kHalfPiLow = 0x1.1a62633145c07p-54;  // the rest of it
  const bool is_back = std::signbit(x);
  const double turn = up <= along ? first_octant(up, along) : first_octant(along, up);
  double angle = turn;
  if (up > along) {
    angle = is_back ? kHalfPi + (turn + kHalfPiLow) : kHalfPi - (turn - kHalfPiLow);
  } else if (is_back) {
    angle = std::numbers::pi - (turn - 2 * kHalfPiLow);
  }
  return std::copysign(angle, y);
}

}  // namespace pointfair::portable
