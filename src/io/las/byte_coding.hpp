// SPDX-License-Identifier: Apache-2.0
// Bytes in an arithmetic code: as they are, or as their difference from a prediction.
#pragma once

#include <array>
#include <cstdint>
#include <memory>

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

}  // namespace pointfair::io::las
