// SPDX-License-Identifier: Apache-2.0
// Item POINT10 of LAZ, version 2: the 20 bytes that all points of formats 0 to 5 have. Its steps, taken in order, read
// a record with an Encoder and fill it with a Decoder.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <string_view>
#include <vector>

#include "io/las/byte_coding.hpp"
#include "io/las/header.hpp"
#include "io/las/integer_coder.hpp"

namespace pointfair::io::las {

/// The item's fields.
struct PointFields {
  Grid grid{};
  std::uint16_t intensity = 0, source = 0;
  std::uint8_t returns = 0, classification = 0, angle = 0, user = 0;

  std::uint32_t number() const { return returns & 7U; }
  std::uint32_t count() const { return (returns >> 3) & 7U; }
  std::uint32_t direction() const { return (returns >> 6) & 1U; }

  static PointFields read(const char* record) {
    PointFields fields{.grid = get_grid(record)};
    fields.intensity = load_little<std::uint16_t>(record + 12);
    fields.returns = load_little<std::uint8_t>(record + 14);
    fields.classification = load_little<std::uint8_t>(record + 15);
    fields.angle = load_little<std::uint8_t>(record + 16);
    fields.user = load_little<std::uint8_t>(record + 17);
    fields.source = load_little<std::uint16_t>(record + 18);
    return fields;
  }
  void write(char* record) const {
    put_grid(grid, record);
    store_little(record + 12, intensity);
    store_little(record + 14, returns);
    store_little(record + 15, classification);
    store_little(record + 16, angle);
    store_little(record + 17, user);
    store_little(record + 18, source);
  }
};

class PointItem {
 public:
  explicit PointItem(const char* first) : last_(PointFields::read(first)) { last_.intensity = 0; }

  static constexpr int kSteps = 4;

  template <int kStep, class Coder>
  void code_step(Coder& coder, char* record) {
    if constexpr (kStep == 0) {
      now_ = Coder::kWrites ? PointFields::read(record) : last_;
      code_fields(coder);
    } else if constexpr (kStep == 1) {
      code_along(coder, x_, x_steps_[kind_of(now_)], last_.grid[0], now_.grid[0], single());
    } else if constexpr (kStep == 2) {
      code_along(coder, y_, y_steps_[kind_of(now_)], last_.grid[1], now_.grid[1], single() + even(x_.last_size(), 20));
    } else {
      code_z(coder);
      last_ = now_;
      if constexpr (!Coder::kWrites) now_.write(record);
    }
  }

 private:
  static constexpr std::uint32_t kSource = 1, kUser = 2, kAngle = 4, kClass = 8, kIntensity = 16, kReturns = 32;

  // One of 16 kinds of returns: row = number of returns, column = number of this one.
  static std::uint32_t kind_of(const PointFields& fields) {
    constexpr std::array<std::string_view, 8> kKinds = {"PONMLKJI", "OABDGKKJ", "NBCEHLLK", "MDEFIMML",
                                                        "LGHIJNNM", "KKLMNOON", "JKLMNOPO", "IJKLMNOP"};
    return static_cast<std::uint32_t>(kKinds[fields.count()][fields.number()] - 'A');
  }

  std::uint32_t changes_of(const PointFields& now) const {
    return (now.source != last_.source ? kSource : 0) | (now.user != last_.user ? kUser : 0) |
           (now.angle != last_.angle ? kAngle : 0) | (now.classification != last_.classification ? kClass : 0) |
           (now.intensity != intensities_[kind_of(now)] ? kIntensity : 0) |
           (now.returns != last_.returns ? kReturns : 0);
  }

  template <class Coder>
  void code_fields(Coder& coder) {
    const std::uint32_t changes = coder.code(changes_, Coder::kWrites ? changes_of(now_) : 0);
    if ((changes & kReturns) != 0) now_.returns = code_byte(coder, returns_.after(last_.returns), now_.returns);
    const std::uint32_t kind = kind_of(now_);
    std::uint16_t& intensity = intensities_[kind];
    if ((changes & kIntensity) != 0)
      intensity = static_cast<std::uint16_t>(
          intensity_.code(coder, intensity, now_.intensity, std::min<std::uint32_t>(kind, 3)));
    now_.intensity = intensity;
    if ((changes & kClass) != 0)
      now_.classification = code_byte(coder, classes_.after(last_.classification), now_.classification);
    if ((changes & kAngle) != 0)
      now_.angle = code_difference(coder, angles_[now_.direction()], last_.angle, now_.angle);
    if ((changes & kUser) != 0) now_.user = code_byte(coder, users_.after(last_.user), now_.user);
    if ((changes & kSource) != 0)
      now_.source = static_cast<std::uint16_t>(source_.code(coder, last_.source, now_.source, 0));
  }

  std::uint32_t single() const { return now_.count() == 1; }

  template <class Coder>
  void code_z(Coder& coder) {
    const int level = std::abs(static_cast<int>(now_.count()) - static_cast<int>(now_.number()));
    std::int32_t& height = heights_[static_cast<std::size_t>(level)];
    const std::uint32_t size = (x_.last_size() + y_.last_size()) / 2;
    height = z_.code(coder, height, now_.grid[2], single() + even(size, 18));
    now_.grid[2] = height;
  }

  PointFields last_, now_;
  std::array<std::uint16_t, 16> intensities_{};
  std::array<RunningMedian, 16> x_steps_, y_steps_;
  std::array<std::int32_t, 8> heights_{};
  SymbolModel changes_{64};
  std::vector<SymbolModel> angles_ = std::vector(2, SymbolModel(256));
  ByteModels returns_, classes_, users_;
  IntegerCoder intensity_{4, 16}, source_{1, 16}, x_{2}, y_{22}, z_{20};
};

}  // namespace pointfair::io::las
