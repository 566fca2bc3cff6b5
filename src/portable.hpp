// SPDX-License-Identifier: Apache-2.0
// Functions that a platform's mathematical library rounds in its own way, made of + - * / and sqrt, which IEEE 754
// rounds in one way. All that a result depends on calls these (tests/platform_functions.py), so it has the same bits
// everywhere. Errors are those that tests/test_portable.cpp measures, relative to the result.
#pragma once

#include "point/exponential.h"

namespace pointfair::portable {

// Error below 3e-16 for -700 < x < 700; else any number. For loops that compilers turn into vectors.
inline double exp_within_700(double x) { return point::exp_within_700(x); }

// Error below 3e-16. 0 below -700, infinite above 700.
double exp(double x);

// Error below 1.5e-16. -infinity of 0, NaN of negative numbers.
double log(double x);

// log(1 + x). Error below 4e-16.
double log1p(double x);

// x >= 0. Error below 4e-16 while the result lies between 1e-27 and 1e27, and 5e-15 beyond; 0 and infinity as in exp().
double pow(double x, double y);

// 10^n. Error below 2e-16 for |n| <= 22, and 1e-16 |n| beyond.
double power_of_ten(int n);

// The greatest n with 10^n <= x, where 10^n is power_of_ten(n); x is positive and finite.
int decimal_exponent(double x);

// The largest power of two that is at most x, and the least that is at least x; x itself if 0 or not finite.
double power_of_two_below(double x);
double power_of_two_above(double x);

// Without overflow or underflow. Errors below 4e-16.
double hypot(double x, double y);
double hypot(double x, double y, double z);

// Error below 3e-16 for |x| < 1e5; beyond, of x modulo 2 pi in double precision. NaN unless x is finite.
double sin(double x);
double cos(double x);

// As std::atan2. Error below 6e-16.
double atan2(double y, double x);

}  // namespace pointfair::portable
