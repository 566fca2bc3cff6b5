// SPDX-License-Identifier: Apache-2.0
#include "io/las/interleaved.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "io/las/byte_coding.hpp"
#include "io/las/color_item.hpp"
#include "io/las/first_items.hpp"
#include "io/las/point_item.hpp"
#include "io/las/time_item.hpp"
#include "io/las/wave_item.hpp"

namespace pointfair::io::las {
namespace {

// An item that is predicted from the last point's bytes.
template <class Bytes, std::size_t kSize>
class ItemAfterLast {
 public:
  explicit ItemAfterLast(const char* first) { std::copy_n(first, kSize, last_.data()); }

  template <class Coder>
  void code(Coder& coder, char* record) {
    bytes_.code(coder, last_.data(), record);
    std::copy_n(record, kSize, last_.data());
  }

 private:
  Bytes bytes_;
  std::array<char, kSize> last_;
};

struct FirstVersion {
  using Point = FirstPointItem;
  using Time = FirstTimeItem;
  using Color = ItemAfterLast<FirstColorCoder, 6>;
  using Bytes = FirstBytesItem;
};
struct SecondVersion {
  using Point = PointItem;
  using Time = TimeItem;
  using Color = ItemAfterLast<ColorCoder, 6>;
  using Bytes = BytesItem;
};

// All items of a point, one point after the other, each in a few steps: with a Decoder records are filled, with an
// Encoder read.
template <class Version>
class RecordCoder {
 public:
  static constexpr int kPointSteps = Version::Point::kSteps;
  using Steps = std::make_integer_sequence<int, kPointSteps + 4>;

  RecordCoder(const Compression& compression, const char* first) : point_(first) {
    std::size_t offset = 0;
    for (const Item& item : compression.items) {
      if (item.type == Item::time11) time_.emplace(first + (time_at_ = offset));
      if (item.type == Item::color12) color_.emplace(first + (color_at_ = offset));
      if (item.type == Item::wave13) wave_.emplace(first + (wave_at_ = offset));
      if (item.type == Item::bytes) bytes_.emplace(first + (bytes_at_ = offset), item.size);
      offset += item.size;
    }
  }

  template <int kStep, class Coder>
  void code_step(Coder& coder, char* record) {
    if constexpr (kStep < kPointSteps) {
      point_.template code_step<kStep>(coder, record);
    } else if constexpr (kStep == kPointSteps) {
      if (time_) time_->code(coder, record + time_at_);
    } else if constexpr (kStep == kPointSteps + 1) {
      if (color_) color_->code(coder, record + color_at_);
    } else if constexpr (kStep == kPointSteps + 2) {
      if (wave_) wave_->code(coder, record + wave_at_);
    } else {
      if (bytes_) bytes_->code(coder, record + bytes_at_);
    }
  }

  bool is_damaged() const { return time_ && time_->is_damaged(); }

 private:
  typename Version::Point point_;
  std::optional<typename Version::Time> time_;
  std::optional<typename Version::Color> color_;
  std::optional<ItemAfterLast<WaveCoder, 29>> wave_;
  std::optional<typename Version::Bytes> bytes_;
  std::size_t time_at_ = 0, color_at_ = 0, wave_at_ = 0, bytes_at_ = 0;
};

// A chunk on its way into records, of which the first one stands in it as it is.
template <class Version>
class ChunkDecoder {
 public:
  using Steps = typename RecordCoder<Version>::Steps;

  ChunkDecoder(const Compression& compression, const CodedChunk& chunk)
      : length_(compression.record_length()),
        decoder_(chunk.bytes.substr(length_)),
        coder_(compression, chunk.bytes.data()),
        record_(chunk.records.data() + length_),
        end_(chunk.records.data() + chunk.records.size()) {
    std::copy_n(chunk.bytes.data(), length_, chunk.records.data());
  }

  bool is_done() const { return record_ == end_; }

  template <int kStep>
  void decode_step() {
    coder_.template code_step<kStep>(decoder_, record_);
  }
  // False: the bytes are damaged.
  bool go_on() {
    record_ += length_;
    return !decoder_.overrun() && !coder_.is_damaged();
  }

 private:
  std::size_t length_;
  Decoder decoder_;
  RecordCoder<Version> coder_;
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
  bool is_sound = true;
  ((is_sound = chunks.go_on() && is_sound), ...);
  return is_sound;
}

template <class Version>
bool decode_rest(ChunkDecoder<Version>& chunk) {
  while (!chunk.is_done()) {
    if (!decode_records(typename ChunkDecoder<Version>::Steps{}, chunk)) return false;
  }
  return true;
}

template <class Version>
bool decode(const Compression& compression, const CodedChunk& chunk) {
  ChunkDecoder<Version> decoder(compression, chunk);
  return decode_rest(decoder);
}

template <int... kStep, class Records>
void encode_record(std::integer_sequence<int, kStep...>, Records& coder, Encoder& encoder, char* record) {
  (coder.template code_step<kStep>(encoder, record), ...);
}

template <class Version>
void encode(const Compression& compression, std::span<const char> records, Encoder& encoder) {
  const std::size_t length = compression.record_length();
  RecordCoder<Version> coder(compression, records.data());
  for (std::size_t at = length; at < records.size(); at += length) {
    char* const record = const_cast<char*>(records.data()) + at;  // which an encoder only reads
    encode_record(typename RecordCoder<Version>::Steps{}, coder, encoder, record);
  }
}

bool is_first_version(const Compression& compression) { return compression.items.front().version == 1; }

}  // namespace

bool decode_interleaved(const Compression& compression, const CodedChunk& chunk) {
  if (chunk.bytes.size() < compression.record_length()) return false;
  return is_first_version(compression) ? decode<FirstVersion>(compression, chunk)
                                       : decode<SecondVersion>(compression, chunk);
}

bool decode_two_interleaved(const Compression& compression, const CodedChunk& one, const CodedChunk& other) {
  if (is_first_version(compression) || std::min(one.bytes.size(), other.bytes.size()) < compression.record_length())
    return false;
  ChunkDecoder<SecondVersion> a(compression, one), b(compression, other);
  while (!a.is_done() && !b.is_done()) {
    if (!decode_records(RecordCoder<SecondVersion>::Steps{}, a, b)) return false;
  }
  return decode_rest(a) && decode_rest(b);
}

void encode_interleaved(const Compression& compression, std::span<const char> records, std::string& to) {
  to.append(records.data(), compression.record_length());
  Encoder encoder(to);
  if (is_first_version(compression)) {
    encode<FirstVersion>(compression, records, encoder);
  } else {
    encode<SecondVersion>(compression, records, encoder);
  }
  encoder.finish();
}

}  // namespace pointfair::io::las
