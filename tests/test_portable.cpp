// SPDX-License-Identifier: Apache-2.0
// The functions of src/portable.hpp against the C library's in long double.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "portable.hpp"

namespace pointfair {
namespace {

using Real = long double;
constexpr double kInfinite = std::numeric_limits<double>::infinity();

double error_of(double got, Real exact) { return double(std::abs((Real(got) - exact) / exact)); }

// Of numbers drawn evenly.
template <typename Check>
void for_each_number(double low, double high, const Check& check) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 50000; ++i) check(low + (high - low) * double(random() >> 11) * 0x1p-53);
}

// Found by the fuzzer, as a spherical coordinate: no integer is the quarter of such an angle.
TEST(Portable, AnglesThatAreNoneHaveNoSine) {
  for (const double angle : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    EXPECT_TRUE(std::isnan(portable::sin(angle)));
    EXPECT_TRUE(std::isnan(portable::cos(-angle)));
  }
}

TEST(Portable, ExponentialIsWithinThreeHalvesOfALastPlace) {
  for_each_number(-690, 690, [](double x) {
    ASSERT_LT(error_of(portable::exp_within_700(x), std::exp(Real(x))), 3e-16) << x;
    ASSERT_EQ(portable::exp(x), portable::exp_within_700(x));
  });
  EXPECT_EQ(portable::exp(0), 1);
  EXPECT_EQ(portable::exp(-1e4), 0);
  EXPECT_EQ(portable::exp(-kInfinite), 0);
  EXPECT_EQ(portable::exp(1e4), kInfinite);
  EXPECT_TRUE(std::isnan(portable::exp(std::nan(""))));
}

TEST(Portable, LogarithmIsTheNearestDoubleNearly) {
  for_each_number(-1070, 1020, [](double power) {
    const double x = std::exp2(power);
    ASSERT_LT(error_of(portable::log(x), std::log(Real(x))), 1.5e-16) << x;
  });
  for_each_number(0.5, 2, [](double x) { ASSERT_LT(error_of(portable::log(x), std::log(Real(x))), 1.5e-16) << x; });
  EXPECT_EQ(portable::log(1), 0);
  EXPECT_EQ(portable::log(0), -kInfinite);
  EXPECT_EQ(portable::log(kInfinite), kInfinite);
  EXPECT_TRUE(std::isnan(portable::log(-1)));
  EXPECT_TRUE(std::isnan(portable::log(std::nan(""))));
}

TEST(Portable, LogarithmOfOneAndALittle) {
  for_each_number(-60, 60, [](double power) {
    const double x = std::exp2(power);
    ASSERT_LT(error_of(portable::log1p(x), std::log1p(Real(x))), 4e-16) << x;
    if (x < 0.99) {
      ASSERT_LT(error_of(portable::log1p(-x), std::log1p(Real(-x))), 4e-16) << -x;
    }
  });
  EXPECT_EQ(portable::log1p(0), 0);
  EXPECT_EQ(portable::log1p(-1), -kInfinite);
}

TEST(Portable, Powers) {
  for_each_number(-30, 30, [](double power) {
    const double x = std::exp2(power);
    for (const double y : {-2.0, -0.6, 1e-3, 0.25, 1.0, 1.7, 3.0})
      ASSERT_LT(error_of(portable::pow(x, y), std::pow(Real(x), Real(y))), 4e-16) << x << ' ' << y;
    ASSERT_LT(error_of(portable::pow(x, 30), std::pow(Real(x), Real(30))), 5e-15) << x;
  });
  EXPECT_EQ(portable::pow(0, 2), 0);
  EXPECT_EQ(portable::pow(0, 0), 1);
  EXPECT_EQ(portable::pow(0, -1), kInfinite);
  EXPECT_EQ(portable::pow(1, 1e300), 1);
  EXPECT_EQ(portable::pow(2, 1e300), kInfinite);
  EXPECT_EQ(portable::pow(2, -1e300), 0);
  EXPECT_TRUE(std::isnan(portable::pow(-2, 2)));
}

TEST(Portable, PowersOfTen) {
  for (int n = -300; n <= 300; ++n) {
    const Real exact = std::pow(Real(10), Real(n));
    EXPECT_LT(error_of(portable::power_of_ten(n), exact), std::abs(n) <= 22 ? 2e-16 : 1e-16 * std::abs(n)) << n;
    EXPECT_EQ(portable::decimal_exponent(portable::power_of_ten(n)), n);
    EXPECT_EQ(portable::decimal_exponent(std::nextafter(portable::power_of_ten(n), 0)), n - 1);
  }
  EXPECT_EQ(portable::power_of_ten(-3), 0.001);
  EXPECT_EQ(portable::decimal_exponent(9.99), 0);
}

TEST(Portable, PowersOfTwo) {
  for (int n = -1074; n <= 1023; ++n) {
    const double power = std::ldexp(1.0, n), next = std::nextafter(power, kInfinite);
    ASSERT_EQ(portable::power_of_two_below(power), power);
    ASSERT_EQ(portable::power_of_two_above(power), power);
    if (n > -1074) {
      ASSERT_EQ(portable::power_of_two_below(next), power);
      ASSERT_EQ(portable::power_of_two_above(next), 2 * power);
    }
  }
  EXPECT_EQ(portable::power_of_two_below(0), 0);
  EXPECT_EQ(portable::power_of_two_above(kInfinite), kInfinite);
}

TEST(Portable, Lengths) {
  for_each_number(-700, 700, [](double power) {
    const double x = std::exp2(power), y = 0.3 * x, z = 1.2 * x;
    ASSERT_LT(error_of(portable::hypot(x, -y), std::hypot(Real(x), Real(y))), 4e-16) << x;
    ASSERT_LT(error_of(portable::hypot(x, y, -z), std::hypot(Real(x), Real(y), Real(z))), 4e-16) << x;
  });
  EXPECT_EQ(portable::hypot(3, 4), 5);
  EXPECT_EQ(portable::hypot(0, 0, 0), 0);
  EXPECT_EQ(portable::hypot(1e300, 1e300, 0), std::numbers::sqrt2 * 1e300);
  EXPECT_EQ(portable::hypot(1, -kInfinite), kInfinite);
}

TEST(Portable, Angles) {
  const auto check = [](double x) {
    const Real sine = std::sin(Real(x)), cosine = std::cos(Real(x));
    ASSERT_LT(error_of(portable::sin(x), sine), 3e-16) << x;
    ASSERT_LT(error_of(portable::cos(x), cosine), 3e-16) << x;
  };
  for_each_number(-7, 7, check);
  for_each_number(-300, 300, check);
  for_each_number(-40, -1, [&](double power) { check(std::exp2(power)); });
  EXPECT_EQ(portable::sin(0), 0);
  EXPECT_EQ(portable::cos(0), 1);
  EXPECT_LE(std::abs(portable::cos(1e22)), 1);
}

TEST(Portable, DirectionsOfAllQuadrants) {
  for_each_number(-10, 10, [](double y) {
    for (const double x : {-5.0, -1e-9, 1e-3, 0.7, 40.0})
      ASSERT_LT(error_of(portable::atan2(y, x), std::atan2(Real(y), Real(x))), 6e-16) << y << ' ' << x;
  });
  for (const double y : {-kInfinite, -1.0, -0.0, 0.0, 1.0, kInfinite})
    for (const double x : {-kInfinite, -1.0, -0.0, 0.0, 1.0, kInfinite}) {
      EXPECT_EQ(portable::atan2(y, x), std::atan2(y, x)) << y << ' ' << x;
      EXPECT_EQ(std::signbit(portable::atan2(y, x)), std::signbit(std::atan2(y, x))) << y << ' ' << x;
    }
  for (const double x : {-1.0, 0.0, kInfinite, std::nan("")}) {
    EXPECT_TRUE(std::isnan(portable::atan2(std::nan(""), x))) << x;
    EXPECT_TRUE(std::isnan(portable::atan2(x, std::nan("")))) << x;
  }
}

}  // namespace
}  // namespace pointfair
