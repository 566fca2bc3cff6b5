// SPDX-License-Identifier: Apache-2.0
// The weights of method learned: a file of whole numbers, as training/net/export.py writes it.
//
//   bytes 0-7    "pfweight"
//   8-11         version, of the net (src/point/net.h) and of this layout
//   12-15        bytes of the weights
//   16-23        fingerprint of the weights: FNV-1a, 64 bits
//   24-27        trust, float
//   28-          the weights, row by row of outputs: input and its bias; of each layer own and its bias, other, edge,
//                update and its bias, and gate where there is one; output and its bias. Biases have 32 bits.
//
// Numbers are little-endian.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "point/net.h"

namespace pointfair {

class NetWeights {
 public:
  // Throws Error(file) with one line that begins with `name`.
  NetWeights(std::span<const std::byte> file, const std::string& name);
  NetWeights(const NetWeights&) = delete;

  // As src/point reads them; valid while this lives.
  const point::net::Weights& view() const { return view_; }
  std::uint64_t fingerprint() const { return fingerprint_; }
  // What the view points into, and a view of copies of both, as a card holds them. Matrices begin at multiples of 16
  // bytes.
  std::span<const std::int8_t> numbers() const { return weights_; }
  std::span<const int> biases() const { return biases_; }
  point::net::Weights view_over(const std::int8_t* numbers, const int* biases) const;

 private:
  std::vector<std::int8_t> weights_;
  std::vector<int> biases_;
  point::net::Weights view_{};
  std::uint64_t fingerprint_ = 0;
};

// Those in the program.
std::shared_ptr<const NetWeights> own_net_weights();

}  // namespace pointfair
