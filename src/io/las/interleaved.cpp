// SPDX-License-Identifier: Apache-2.0
#include "io/las/interleaved.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "io/las/byte_coding.hpp"
#include "io/las/point_item.hpp"
#include "io/las/time_item.hpp"

namespace pointfair::io::las {
namespace {

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

// All items of a point, one point after the other, each in a few steps: with a Decoder records are filled, with an
// Encoder read.
class RecordCoder {
 public:
  using Steps = std::make_integer_sequence<int, PointItem::kSteps + 3>;

  RecordCoder(const Compression& compression, const char* first) : point_(first) {
    std::size_t offset = 0;
    for (const Item& item : compression.items) {
      if (item.type == Item::time11) time_.emplace(first + (time_at_ = offset));
      if (item.type == Item::color12) color_.emplace(first + (color_at_ = offset));
      if (item.type == Item::bytes) bytes_.emplace(first + (bytes_at_ = offset), item.size);
      offset += item.size;
    }
  }

  template <int kStep, class Coder>
  void code_step(Coder& coder, char* record) {
    if constexpr (kStep < PointItem::kSteps) {
      point_.code_step<kStep>(coder, record);
    } else if constexpr (kStep == PointItem::kSteps) {
      if (time_) time_->code(coder, record + time_at_);
    } else if constexpr (kStep == PointItem::kSteps + 1) {
      if (color_) color_->code(coder, record + color_at_);
    } else {
      if (bytes_) bytes_->code(coder, record + bytes_at_);
    }
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

// A chunk on its way into records, of which the first one stands in it as it is.
class ChunkDecoder {
 public:
  ChunkDecoder(const Compression& compression, const CodedChunk& chunk)
      : length_(record_length(compression)),
        decoder_(chunk.bytes.substr(length_)),
        coder_(compression, chunk.bytes.data()),
        record_(chunk.records.data() + length_),
        end_(chunk.records.data() + chunk.records.size()) {
    std::copy_n(chunk.bytes.data(), length_, chunk.records.data());
  }

  bool is_done() const { return record_ == end_; }

  template <int kStep>
  void decode_step() {
    coder_.code_step<kStep>(decoder_, record_);
  }
  // False: the bytes are damaged.
  bool go_on() {
    record_ += length_;
    return !decoder_.overrun() && !coder_.is_damaged();
  }

 private:
  std::size_t length_;
  Decoder decoder_;
  RecordCoder coder_;
  char *record_, *end_;
};

// The next record of each chunk, by turns: what comes next in a code is known only when the last is, and meanwhile
// the processor works on the other chunk.
template <int... kStep, class... Chunks>
bool decode_records(std::integer_sequence<int, kStep...>, Chunks&... chunks) {
  const auto decode_step = [&]<int kOne>(std::integral_constant<int, kOne>) {
    (chunks.template decode_step<kOne>(), ...);
  };
  (decode_step(std::integral_constant<int, kStep>{}), ...);
  return (chunks.go_on() & ...);
}

template <int... kStep>
void encode_record(std::integer_sequence<int, kStep...>, RecordCoder& coder, Encoder& encoder, char* record) {
  (coder.code_step<kStep>(encoder, record), ...);
}

bool decode_rest(ChunkDecoder& chunk) {
  while (!chunk.is_done()) {
    if (!decode_records(RecordCoder::Steps{}, chunk)) return false;
  }
  return true;
}

}  // namespace

bool is_interleaved(const Compression& compression) {
  return std::all_of(compression.items.begin(), compression.items.end(), [](const Item& item) {
    const bool known = item.type == Item::point10 || item.type == Item::time11 || item.type == Item::color12 ||
                       item.type == Item::bytes;
    return known && item.version == 2;
  });
}

bool decode_interleaved(const Compression& compression, const CodedChunk& chunk) {
  if (chunk.bytes.size() < record_length(compression)) return false;
  ChunkDecoder decoder(compression, chunk);
  return decode_rest(decoder);
}

bool decode_two_interleaved(const Compression& compression, const CodedChunk& one, const CodedChunk& other) {
  if (std::min(one.bytes.size(), other.bytes.size()) < record_length(compression)) return false;
  ChunkDecoder a(compression, one), b(compression, other);
  while (!a.is_done() && !b.is_done()) {
    if (!decode_records(RecordCoder::Steps{}, a, b)) return false;
  }
  return decode_rest(a) && decode_rest(b);
}

void encode_interleaved(const Compression& compression, std::span<const char> records, std::string& to) {
  const std::size_t length = record_length(compression);
  to.append(records.data(), length);
  Encoder encoder(to);
  RecordCoder coder(compression, records.data());
  for (std::size_t at = length; at < records.size(); at += length) {
    char* const record = const_cast<char*>(records.data()) + at;  // which an encoder only reads
    encode_record(RecordCoder::Steps{}, coder, encoder, record);
  }
  encoder.finish();
}

}  // namespace pointfair::io::las
