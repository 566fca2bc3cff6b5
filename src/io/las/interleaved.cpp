// SPDX-License-Identifier: Apache-2.0
#include "io/las/interleaved.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <optional>
#include <vector>

#include "io/las/grid.hpp"
#include "io/las/integer_coder.hpp"
#include "io/scalar.hpp"

namespace pointfair::io::las {
namespace {

constexpr bool kSwap = std::endian::native == std::endian::big;

template <class T>
void put(char* to, T value) {
  copy_scalar(to, reinterpret_cast<const char*>(&value), sizeof value, kSwap);
}

// A model for each value that a byte had before; most are never needed.
class ByteModels {
 public:
  SymbolModel& after(std::uint8_t last) {
    std::unique_ptr<SymbolModel>& model = models_[last];
    if (!model) model = std::make_unique<SymbolModel>(256);
    return *model;
  }

 private:
  std::array<std::unique_ptr<SymbolModel>, 256> models_;
};

template <class Coder>
std::uint8_t code_byte(Coder& coder, SymbolModel& model, std::uint32_t value) {
  return static_cast<std::uint8_t>(coder.code(model, value & 255));
}

// The byte as its difference from a prediction.
template <class Coder>
std::uint8_t code_difference(Coder& coder, SymbolModel& model, std::uint32_t prediction, std::uint32_t value) {
  return static_cast<std::uint8_t>(prediction + coder.code(model, (value - prediction) & 255));
}

// Item POINT10: the 20 bytes that all points have.
class PointItem {
 public:
  explicit PointItem(const char* first) : last_(read(first)) { last_.intensity = 0; }

  template <class Coder>
  void code(Coder& coder, char* record) {
    Fields now = Coder::kWrites ? read(record) : last_;
    code_fields(coder, now);
    code_place(coder, now);
    last_ = now;
    if constexpr (!Coder::kWrites) write(now, record);
  }

 private:
  struct Fields {
    Grid grid{};
    std::uint16_t intensity = 0, source = 0;
    std::uint8_t returns = 0, classification = 0, angle = 0, user = 0;

    std::uint32_t number() const { return returns & 7U; }
    std::uint32_t count() const { return (returns >> 3) & 7U; }
    std::uint32_t direction() const { return (returns >> 6) & 1U; }
  };
  static constexpr std::uint32_t kSource = 1, kUser = 2, kAngle = 4, kClass = 8, kIntensity = 16, kReturns = 32;

  static Fields read(const char* record) {
    Fields fields;
    for (std::size_t axis = 0; axis < 3; ++axis) fields.grid[axis] = load<std::int32_t>(record + 4 * axis, kSwap);
    fields.intensity = load<std::uint16_t>(record + 12, kSwap);
    fields.returns = load<std::uint8_t>(record + 14, false);
    fields.classification = load<std::uint8_t>(record + 15, false);
    fields.angle = load<std::uint8_t>(record + 16, false);
    fields.user = load<std::uint8_t>(record + 17, false);
    fields.source = load<std::uint16_t>(record + 18, kSwap);
    return fields;
  }
  static void write(const Fields& fields, char* record) {
    for (std::size_t axis = 0; axis < 3; ++axis) put(record + 4 * axis, fields.grid[axis]);
    put(record + 12, fields.intensity);
    put(record + 14, fields.returns);
    put(record + 15, fields.classification);
    put(record + 16, fields.angle);
    put(record + 17, fields.user);
    put(record + 18, fields.source);
  }

  // One of 16 kinds of returns: row = number of returns, column = number of this one.
  static std::uint32_t kind_of(const Fields& fields) {
    constexpr std::array<std::string_view, 8> kKinds = {"PONMLKJI", "OABDGKKJ", "NBCEHLLK", "MDEFIMML",
                                                        "LGHIJNNM", "KKLMNOON", "JKLMNOPO", "IJKLMNOP"};
    return static_cast<std::uint32_t>(kKinds[fields.count()][fields.number()] - 'A');
  }

  std::uint32_t changes_of(const Fields& now) const {
    return (now.source != last_.source ? kSource : 0) | (now.user != last_.user ? kUser : 0) |
           (now.angle != last_.angle ? kAngle : 0) | (now.classification != last_.classification ? kClass : 0) |
           (now.intensity != intensities_[kind_of(now)] ? kIntensity : 0) |
           (now.returns != last_.returns ? kReturns : 0);
  }

  template <class Coder>
  void code_fields(Coder& coder, Fields& now) {
    const std::uint32_t changes = coder.code(changes_, Coder::kWrites ? changes_of(now) : 0);
    if ((changes & kReturns) != 0) now.returns = code_byte(coder, returns_.after(last_.returns), now.returns);
    const std::uint32_t kind = kind_of(now);
    std::uint16_t& intensity = intensities_[kind];
    if ((changes & kIntensity) != 0) {
      intensity = static_cast<std::uint16_t>(
          intensity_.code(coder, intensity, now.intensity, std::min<std::uint32_t>(kind, 3)));
    }
    now.intensity = intensity;
    if ((changes & kClass) != 0)
      now.classification = code_byte(coder, classes_.after(last_.classification), now.classification);
    if ((changes & kAngle) != 0) now.angle = code_difference(coder, angles_[now.direction()], last_.angle, now.angle);
    if ((changes & kUser) != 0) now.user = code_byte(coder, users_.after(last_.user), now.user);
    if ((changes & kSource) != 0)
      now.source = static_cast<std::uint16_t>(source_.code(coder, last_.source, now.source, 0));
  }

  template <class Coder>
  void code_place(Coder& coder, Fields& now) {
    const std::uint32_t kind = kind_of(now), single = now.count() == 1;
    const auto even = [](std::uint32_t size, std::uint32_t most) { return size < most ? size & ~1U : most; };
    code_step(coder, x_, x_steps_[kind], last_.grid[0], now.grid[0], single);
    code_step(coder, y_, y_steps_[kind], last_.grid[1], now.grid[1], single + even(x_.last_size(), 20));
    const int level = std::abs(static_cast<int>(now.count()) - static_cast<int>(now.number()));
    std::int32_t& height = heights_[static_cast<std::size_t>(level)];
    const std::uint32_t size = (x_.last_size() + y_.last_size()) / 2;
    height = z_.code(coder, height, now.grid[2], single + even(size, 18));
    now.grid[2] = height;
  }

  template <class Coder>
  static void code_step(Coder& coder, IntegerCoder& integers, RunningMedian& steps, std::int32_t last,
                        std::int32_t& now, std::uint32_t context) {
    const auto wanted = static_cast<std::int32_t>(static_cast<std::uint32_t>(now) - static_cast<std::uint32_t>(last));
    const std::int32_t step = integers.code(coder, steps.value(), wanted, context);
    steps.add(step);
    now = static_cast<std::int32_t>(static_cast<std::uint32_t>(last) + static_cast<std::uint32_t>(step));
  }

  Fields last_;
  std::array<std::uint16_t, 16> intensities_{};
  std::array<RunningMedian, 16> x_steps_, y_steps_;
  std::array<std::int32_t, 8> heights_{};
  SymbolModel changes_{64};
  std::vector<SymbolModel> angles_ = std::vector(2, SymbolModel(256));
  ByteModels returns_, classes_, users_;
  IntegerCoder intensity_{4, 16}, source_{1, 16}, x_{2}, y_{22}, z_{20};
};

// Item GPSTIME11: the bits of a double, as differences within up to four sequences of times.
class TimeItem {
 public:
  explicit TimeItem(const char* first) { times_[0] = load<std::uint64_t>(first, kSwap); }

  template <class Coder>
  void code(Coder& coder, char* record) {
    const std::uint64_t time = Coder::kWrites ? load<std::uint64_t>(record, kSwap) : 0;
    // a time goes over to another sequence at most once; damaged bytes may say otherwise
    int switches = 0;
    while (code_in_sequence(coder, time)) {
      if (++switches > 1) {
        damaged_ = true;
        break;
      }
    }
    if constexpr (!Coder::kWrites) put(record, times_[at_]);
  }

  bool is_damaged() const { return damaged_; }

 private:
  static constexpr std::int32_t kMost = 500, kLeast = -10;  // multiples of the last difference
  static constexpr std::uint32_t kUnchanged = 511, kNew = 512, kSymbols = 516;  // above kNew: other sequences
  static constexpr std::uint32_t kFirstSame = 0, kFirstStep = 1, kFirstNew = 2;  // above: other sequences

  std::int64_t step_from(std::uint32_t sequence, std::uint64_t time) const {
    return static_cast<std::int64_t>(time - times_[sequence]);
  }
  static bool is_short(std::int64_t step) { return step == static_cast<std::int32_t>(step); }

  // How many sequences farther one is that the time continues; 0: there is none.
  std::uint32_t other_sequence(std::uint64_t time) const {
    for (std::uint32_t i = 1; i < 4; ++i) {
      if (is_short(step_from((at_ + i) & 3, time))) return i;
    }
    return 0;
  }

  std::uint32_t first_symbol(std::uint64_t time) const {
    const std::int64_t step = step_from(at_, time);
    if (is_short(step)) return step == 0 ? kFirstSame : kFirstStep;
    return kFirstNew + other_sequence(time);
  }

  std::uint32_t multiple_symbol(std::uint64_t time) const {
    const std::int64_t step = step_from(at_, time);
    if (!is_short(step)) return kNew + other_sequence(time);
    if (step == 0) return kUnchanged;
    const double ratio = static_cast<float>(step) / static_cast<float>(steps_[at_]);
    const double bounded = std::clamp(ratio, 2.0 * kLeast, 2.0 * kMost);
    const auto multiple = static_cast<std::int32_t>(bounded + (ratio >= 0 ? 0.5 : -0.5));
    if (multiple >= 0) return static_cast<std::uint32_t>(std::min(multiple, kMost));
    return static_cast<std::uint32_t>(kMost - std::max(multiple, kLeast));
  }

  // True: the time is in another sequence, from which to go on.
  template <class Coder>
  bool code_in_sequence(Coder& coder, std::uint64_t time) {
    const bool first = steps_[at_] == 0;
    const std::uint32_t fresh = first ? kFirstNew : kNew;
    const std::uint32_t symbol = first ? coder.code(first_, Coder::kWrites ? first_symbol(time) : 0)
                                       : coder.code(multiples_, Coder::kWrites ? multiple_symbol(time) : 0);
    if (symbol > fresh) {
      at_ = (at_ + symbol - fresh) & 3;
      return true;
    }
    if (symbol == fresh) {
      begin_sequence(coder, time);
    } else if (first && symbol == kFirstStep) {
      steps_[at_] = code_step(coder, time, 0, 0);
      extremes_[at_] = 0;
    } else if (!first && symbol != kUnchanged) {
      code_multiple(coder, time, static_cast<std::int32_t>(symbol));
    }
    return false;
  }

  template <class Coder>
  std::int32_t code_step(Coder& coder, std::uint64_t time, std::int32_t multiple, std::uint32_t context) {
    const auto prediction = static_cast<std::uint32_t>(multiple) * static_cast<std::uint32_t>(steps_[at_]);
    const auto wanted = static_cast<std::int32_t>(step_from(at_, time));
    const std::int32_t step = integers_.code(coder, static_cast<std::int32_t>(prediction), wanted, context);
    times_[at_] += static_cast<std::uint64_t>(std::int64_t{step});
    return step;
  }

  template <class Coder>
  void code_multiple(Coder& coder, std::uint64_t time, std::int32_t symbol) {
    const std::int32_t multiple = symbol <= kMost ? symbol : kMost - symbol;
    const std::uint32_t context = multiple == 1       ? 1
                                  : multiple == 0     ? 7
                                  : multiple == kMost ? 4
                                  : multiple >= 10    ? 3
                                  : multiple > 0      ? 2
                                  : multiple > kLeast ? 5
                                                      : 6;
    const std::int32_t step = code_step(coder, time, multiple, context);
    if (multiple == 1) extremes_[at_] = 0;
    const bool extreme = multiple == 0 || multiple == kMost || multiple == kLeast;
    if (extreme && ++extremes_[at_] > 3) {  // the usual step is another one now
      steps_[at_] = step;
      extremes_[at_] = 0;
    }
  }

  template <class Coder>
  void begin_sequence(Coder& coder, std::uint64_t time) {
    const auto upper_half = [](std::uint64_t value) { return static_cast<std::int32_t>(value >> 32); };
    const std::int32_t upper = integers_.code(coder, upper_half(times_[at_]), upper_half(time), 8);
    const std::uint32_t lower = coder.code_bits(32, static_cast<std::uint32_t>(time));
    newest_ = (newest_ + 1) & 3;
    at_ = newest_;
    times_[at_] = std::uint64_t{static_cast<std::uint32_t>(upper)} << 32 | lower;
    steps_[at_] = 0;
    extremes_[at_] = 0;
  }

  std::uint32_t at_ = 0, newest_ = 0;  // sequences
  std::array<std::uint64_t, 4> times_{};
  std::array<std::int32_t, 4> steps_{}, extremes_{};
  BasicSymbolModel<kSymbols> multiples_{kSymbols};
  SymbolModel first_{6};
  IntegerCoder integers_{9};
  bool damaged_ = false;
};

// Item RGB12: the lower bytes of three channels, and the upper ones, each predicted from the channel before.
class ColorItem {
 public:
  explicit ColorItem(const char* first) : last_(read(first)) {}

  template <class Coder>
  void code(Coder& coder, char* record) {
    Color now = Coder::kWrites ? read(record) : last_;
    const std::uint32_t changes = coder.code(changes_, Coder::kWrites ? changes_of(now) : 0);
    for (std::uint32_t half = 0; half < 2; ++half) {
      if ((changes >> half & 1) != 0) now[0][half] = code_difference(coder, bytes_[half], last_[0][half], now[0][half]);
    }
    for (std::uint32_t half = 0; half < 2; ++half) {
      if ((changes & kColored) != 0) {
        code_others(coder, changes >> half, half, now);
      } else {
        now[1][half] = now[2][half] = now[0][half];
      }
    }
    last_ = now;
    if constexpr (!Coder::kWrites) {
      for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t half = 0; half < 2; ++half) record[2 * c + half] = static_cast<char>(now[c][half]);
    }
  }

 private:
  using Color = std::array<std::array<std::uint8_t, 2>, 3>;  // of a channel the lower byte, then the upper
  static constexpr std::uint32_t kColored = 64;              // the channels are not all alike

  static Color read(const char* record) {
    Color color;
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t half = 0; half < 2; ++half) color[c][half] = static_cast<std::uint8_t>(record[2 * c + half]);
    return color;
  }

  std::uint32_t changes_of(const Color& now) const {
    std::uint32_t changes = now[0] != now[1] || now[0] != now[2] ? kColored : 0;
    for (std::uint32_t c = 0; c < 3; ++c)
      for (std::uint32_t half = 0; half < 2; ++half)
        changes |= static_cast<std::uint32_t>(now[c][half] != last_[c][half]) << (2 * c + half);
    return changes;
  }

  // Bits 2 and 4 of `changes` say whether the second and the third channel changed.
  template <class Coder>
  void code_others(Coder& coder, std::uint32_t changes, std::uint32_t half, Color& now) {
    const auto near = [](int value) { return static_cast<std::uint32_t>(std::clamp(value, 0, 255)); };
    int difference = now[0][half] - last_[0][half];
    if ((changes & 4) != 0)
      now[1][half] = code_difference(coder, bytes_[2 + half], near(difference + last_[1][half]), now[1][half]);
    difference = (difference + now[1][half] - last_[1][half]) / 2;
    if ((changes & 16) != 0)
      now[2][half] = code_difference(coder, bytes_[4 + half], near(difference + last_[2][half]), now[2][half]);
  }

  Color last_;
  SymbolModel changes_{128};
  std::vector<SymbolModel> bytes_ = std::vector(6, SymbolModel(256));
};

// Item BYTE: each as its difference from the last point's.
class BytesItem {
 public:
  BytesItem(const char* first, std::size_t count) : last_(first, first + count), models_(count, SymbolModel(256)) {}

  template <class Coder>
  void code(Coder& coder, char* record) {
    for (std::size_t i = 0; i < last_.size(); ++i) {
      const auto wanted = Coder::kWrites ? static_cast<std::uint8_t>(record[i]) : std::uint8_t{0};
      last_[i] = code_difference(coder, models_[i], last_[i], wanted);
      if constexpr (!Coder::kWrites) record[i] = static_cast<char>(last_[i]);
    }
  }

 private:
  std::vector<std::uint8_t> last_;
  std::vector<SymbolModel> models_;
};

// All items of a point, one point after the other: with a Decoder records are filled, with an Encoder read.
class RecordCoder {
 public:
  RecordCoder(const Compression& compression, const char* first) : point_(first) {
    std::size_t offset = 0;
    for (const Item& item : compression.items) {
      if (item.type == Item::time11) time_.emplace(first + (time_at_ = offset));
      if (item.type == Item::color12) color_.emplace(first + (color_at_ = offset));
      if (item.type == Item::bytes) bytes_.emplace(first + (bytes_at_ = offset), item.size);
      offset += item.size;
    }
  }

  template <class Coder>
  void code(Coder& coder, char* record) {
    point_.code(coder, record);
    if (time_) time_->code(coder, record + time_at_);
    if (color_) color_->code(coder, record + color_at_);
    if (bytes_) bytes_->code(coder, record + bytes_at_);
  }

  bool is_damaged() const { return time_ && time_->is_damaged(); }

 private:
  PointItem point_;
  std::optional<TimeItem> time_;
  std::optional<ColorItem> color_;
  std::optional<BytesItem> bytes_;
  std::size_t time_at_ = 0, color_at_ = 0, bytes_at_ = 0;
};

std::size_t record_length(const Compression& compression) {
  std::size_t length = 0;
  for (const Item& item : compression.items) length += item.size;
  return length;
}

}  // namespace

bool is_interleaved(const Compression& compression) {
  return std::all_of(compression.items.begin(), compression.items.end(), [](const Item& item) {
    const bool known = item.type == Item::point10 || item.type == Item::time11 || item.type == Item::color12 ||
                       item.type == Item::bytes;
    return known && item.version == 2;
  });
}

bool decode_interleaved(const Compression& compression, std::string_view chunk, std::span<char> records) {
  const std::size_t length = record_length(compression);
  if (chunk.size() < length) return false;
  std::copy_n(chunk.data(), length, records.data());
  Decoder decoder(chunk.substr(length));
  RecordCoder coder(compression, chunk.data());
  for (char* record = records.data() + length; record != records.data() + records.size(); record += length) {
    coder.code(decoder, record);
    if (decoder.overrun() || coder.is_damaged()) return false;
  }
  return true;
}

void encode_interleaved(const Compression& compression, std::span<const char> records, std::string& to) {
  const std::size_t length = record_length(compression);
  to.append(records.data(), length);
  Encoder encoder(to);
  RecordCoder coder(compression, records.data());
  std::string record(length, '\0');
  for (std::size_t at = length; at < records.size(); at += length) {
    std::copy_n(records.data() + at, length, record.data());
    coder.code(encoder, record.data());
  }
  encoder.finish();
}

}  // namespace pointfair::io::las
