// SPDX-License-Identifier: Apache-2.0
// Bytes in an arithmetic code: as they are, or as their difference from a prediction.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "io/las/arithmetic.hpp"

namespace pointfair::io::las {

// A model for each value that was before; most are never needed.
template <std::size_t kContexts, std::uint32_t kSymbols>
class ModelsByContext {
 public:
  SymbolModel& after(std::uint32_t context) {
    std::unique_ptr<SymbolModel>& model = models_[context];
    if (!model) model = std::make_unique<SymbolModel>(kSymbols);
    return *model;
  }

 private:
  std::array<std::unique_ptr<SymbolModel>, kContexts> models_;
};
using ByteModels = ModelsByContext<256, 256>;

template <class Coder>
std::uint8_t code_byte(Coder& coder, SymbolModel& model, std::uint32_t value) {
  return static_cast<std::uint8_t>(coder.code(model, value & 255));
}

// The byte as its difference from a prediction.
template <class Coder>
std::uint8_t code_difference(Coder& coder, SymbolModel& model, std::uint32_t prediction, std::uint32_t value) {
  return static_cast<std::uint8_t>(prediction + coder.code(model, (value - prediction) & 255));
}

// Eight bytes as they are.
template <class Coder>
inline std::uint64_t code_long(Coder& coder, std::uint64_t value) {
  const std::uint64_t lower = coder.code_bits(32, static_cast<std::uint32_t>(value));
  return lower | std::uint64_t{coder.code_bits(32, static_cast<std::uint32_t>(value >> 32))} << 32;
}

// Bytes as their differences from the last point's, each with a model of its own.
class ByteDifferences {
 public:
  explicit ByteDifferences(std::size_t bytes) : models_(bytes, SymbolModel(256)) {}

  template <class Coder>
  std::int32_t code(Coder& coder, std::int32_t last, std::int32_t value, std::uint32_t byte) {
    return code_difference(coder, models_[byte], static_cast<std::uint32_t>(last), static_cast<std::uint32_t>(value));
  }

 private:
  std::vector<SymbolModel> models_;
};

// Which of some bytes are other than the last point's, and the differences of those.
template <std::uint32_t kBytes, class Differences>
class ChangedBytes {
 public:
  template <class Coder>
  void code(Coder& coder, const char* last, char* record) {
    std::uint32_t wanted = 0;
    for (std::uint32_t i = 0; Coder::kWrites && i < kBytes; ++i)
      wanted |= static_cast<std::uint32_t>(record[i] != last[i]) << i;
    const std::uint32_t changes = coder.code(changes_, wanted);
    for (std::uint32_t i = 0; i < kBytes; ++i) {
      const auto before = static_cast<std::uint8_t>(last[i]);
      std::int32_t now = Coder::kWrites ? static_cast<std::uint8_t>(record[i]) : before;
      if ((changes >> i & 1) != 0) now = differences_.code(coder, before, now, i);
      if constexpr (!Coder::kWrites) record[i] = static_cast<char>(now);
    }
  }

 private:
  SymbolModel changes_{1U << kBytes};
  Differences differences_{kBytes};
};

// Item BYTE: all bytes, each as its difference.
template <class Differences>
class BasicBytesItem {
 public:
  BasicBytesItem(const char* first, std::size_t count) : last_(first, first + count), differences_(count) {}

  template <class Coder>
  void code(Coder& coder, char* record) {
    for (std::uint32_t i = 0; i < last_.size(); ++i) {
      const std::int32_t wanted = Coder::kWrites ? static_cast<std::uint8_t>(record[i]) : 0;
      last_[i] = static_cast<std::uint8_t>(differences_.code(coder, last_[i], wanted, i));
      if constexpr (!Coder::kWrites) record[i] = static_cast<char>(last_[i]);
    }
  }

 private:
  std::vector<std::uint8_t> last_;
  Differences differences_;
};
using BytesItem = BasicBytesItem<ByteDifferences>;

}  // namespace pointfair::io::las
