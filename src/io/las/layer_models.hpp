// SPDX-License-Identifier: Apache-2.0
// What codes the values of each layer of point formats 6 to 10 in one scanner channel. `code` gets the channel's last
// value and the place of the value in the record, which a Decoder fills. They are made where the channel begins, with
// the value before.
#pragma once

#include <array>
#include <cstdint>

#include "io/las/byte_coding.hpp"
#include "io/las/color_item.hpp"
#include "io/las/integer_coder.hpp"
#include "io/las/layers.hpp"
#include "io/las/time_item.hpp"
#include "io/las/wave_item.hpp"

namespace pointfair::io::las::layer_models {

// Whether a return is the first (2) and the last (1) of its pulse.
inline std::uint32_t place_of(Returns returns) {
  return (returns.number == 1 ? 2 : 0) | (returns.number >= returns.count);
}

inline std::uint8_t byte(char value) { return static_cast<std::uint8_t>(value); }

// An encoder's records are only read.
template <class Coder, class T>
void put_decoded(T now, char* value) {
  if constexpr (!Coder::kWrites) store_little(value, now);
}

struct Classifications {
  static constexpr std::size_t kSize = 1;
  explicit Classifications(const char*) {}

  template <class Coder>
  void code(Coder& coder, Returns returns, const char* last, char* value) {
    const std::uint32_t context = (byte(*last) & 31U) << 1 | (place_of(returns) == 3);
    put_decoded<Coder>(code_byte(coder, models_.after(context), byte(*value)), value);
  }

 private:
  ModelsByContext<64, 256> models_;
};

struct Flags {
  static constexpr std::size_t kSize = 1;
  explicit Flags(const char*) {}

  static std::uint32_t of(char value) { return (byte(value) & 15U) | (byte(value) >> 2 & 0x30U); }

  template <class Coder>
  void code(Coder& coder, Returns returns, const char* last, char* value) {
    const std::uint32_t flags = coder.code(models_.after(of(*last)), of(*value));
    const std::uint32_t channel = returns.channel;
    put_decoded<Coder>(static_cast<std::uint8_t>((flags & 15) | channel << 4 | (flags & 0x30) << 2), value);
  }

 private:
  ModelsByContext<64, 64> models_;
};

struct Intensities {
  static constexpr std::size_t kSize = 2;
  explicit Intensities(const char* last) { last_.fill(load_little<std::uint16_t>(last)); }

  template <class Coder>
  void code(Coder& coder, Returns returns, const char*, char* value) {
    const std::uint32_t place = place_of(returns);
    std::uint16_t& last = last_[place << 1 | returns.time_changed];
    last = static_cast<std::uint16_t>(integers_.code(coder, last, load_little<std::uint16_t>(value), place));
    put_decoded<Coder>(last, value);
  }

 private:
  std::array<std::uint16_t, 8> last_;
  IntegerCoder integers_{4, 16};
};

struct ScanAngles {
  static constexpr std::size_t kSize = 2;
  explicit ScanAngles(const char*) {}

  template <class Coder>
  void code(Coder& coder, Returns returns, const char* last, char* value) {
    auto now = load_little<std::uint16_t>(last);
    if (returns.angle_changed) {
      const std::int32_t wanted = load_little<std::uint16_t>(value);
      now = static_cast<std::uint16_t>(integers_.code(coder, now, wanted, returns.time_changed));
    }
    put_decoded<Coder>(now, value);
  }

 private:
  IntegerCoder integers_{2, 16};
};

struct UserData {
  static constexpr std::size_t kSize = 1;
  explicit UserData(const char*) {}

  template <class Coder>
  void code(Coder& coder, Returns, const char* last, char* value) {
    put_decoded<Coder>(code_byte(coder, models_.after(byte(*last) / 4U), byte(*value)), value);
  }

 private:
  ModelsByContext<64, 256> models_;
};

struct PointSources {
  static constexpr std::size_t kSize = 2;
  explicit PointSources(const char*) {}

  template <class Coder>
  void code(Coder& coder, Returns returns, const char* last, char* value) {
    auto now = load_little<std::uint16_t>(last);
    if (returns.source_changed)
      now = static_cast<std::uint16_t>(integers_.code(coder, now, load_little<std::uint16_t>(value), 0));
    put_decoded<Coder>(now, value);
  }

 private:
  IntegerCoder integers_{1, 16};
};

struct Times {
  static constexpr std::size_t kSize = 8;
  explicit Times(const char* last) : times_(last) {}

  template <class Coder>
  void code(Coder& coder, Returns returns, const char* last, char* value) {
    if (returns.time_changed) {
      times_.code(coder, value);
    } else {
      put_decoded<Coder>(load_little<std::uint64_t>(last), value);
    }
  }
  bool is_damaged() const { return times_.is_damaged(); }

 private:
  LayeredTimeItem times_;
};

template <class Models, std::size_t kBytes>
struct ByLastBytes {
  static constexpr std::size_t kSize = kBytes;
  explicit ByLastBytes(const char*) {}

  template <class Coder>
  void code(Coder& coder, Returns, const char* last, char* value) {
    models_.code(coder, last, value);
  }

 private:
  Models models_;
};
using Colors = ByLastBytes<ColorCoder, 6>;
using NearInfrared = ByLastBytes<NearInfraredCoder, 2>;
using Waves = ByLastBytes<WaveCoder, 29>;

struct ExtraBytes {
  static constexpr std::size_t kSize = 1;
  explicit ExtraBytes(const char*) {}

  template <class Coder>
  void code(Coder& coder, Returns, const char* last, char* value) {
    put_decoded<Coder>(code_difference(coder, model_, byte(*last), byte(*value)), value);
  }

 private:
  SymbolModel model_{256};
};

}  // namespace pointfair::io::las::layer_models
