// SPDX-License-Identifier: Apache-2.0
// How much of a displacement the noise of its place justifies.
#pragma once

#include "point/vec.h"

namespace pointfair::point {

// The variance of the heights of a point's neighbours over its plane.
template <class F>
struct HeightSpread {
  F count{}, sum{}, squares{};

  template <class Mask>
  POINTFAIR_INLINE void add(F height, Mask inside) {
    count = count + select(inside, F(1.0f), F{});
    sum = sum + select(inside, height, F{});
    squares = squares + select(inside, height * height, F{});
  }
  // 0 without neighbours
  POINTFAIR_INLINE F variance() const {
    const F inverse = select(count > F{}, F(1.0f) / count, F{});
    const F mean = sum * inverse;
    return larger(squares * inverse - mean * mean, F{});
  }
};

// Up to kChance of the noise's variance may be missing or too much by chance; after the first iteration kNoiseLeft of
// it is left.
inline constexpr float kChance = 0.3f, kNoiseLeft = 0.1f;

// The share of a displacement that noise justifies, as a local Wiener filter has it: noise / (noise + damage x shape).
// `variance`: of the heights; `noise`: the variance of the noise before the first iteration; `left`: how much of it the
// heights still hold, 1 in the first iteration and kNoiseLeft in later ones; `damage`: what the step does to a shape,
// in its variance within the neighbourhood. Noise far below `trusted`, a variance, is next to none.
template <class F>
POINTFAIR_INLINE F noise_share(F variance, F noise, float left, float damage, float trusted) {
  const F shape = larger(variance - noise * (left + kChance), F{});
  const F doubt = F(trusted) / larger(noise, F(1e-12f) * trusted);
  const F whole = (noise + shape * damage) * (F(1.0f) + doubt * doubt);
  return select(whole > F{}, noise / whole, F{});
}
}  // namespace pointfair::point
