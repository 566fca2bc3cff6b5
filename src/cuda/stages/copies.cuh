// SPDX-License-Identifier: Apache-2.0
// Points of a cloud on the card that are set aside, being copies of others.
#pragma once

#include <span>
#include <vector>

#include "cuda/runtime/memory.cuh"
#include "seam/copies.hpp"

namespace pointfair::cuda {

struct CopyOnCard {
  std::uint32_t point, first;
  float x, y, z;
};

class CopiesAside {
 public:
  explicit CopiesAside(Context& context) : on_card_(context), context_(context) {}

  bool any() const { return !copies_.empty(); }
  std::span<const Copy> all() const { return copies_; }
  void forget();
  void set(std::vector<Copy> copies);

  // Start the work. Points in upload order: takes the copies out of the cloud, and puts them back where they were.
  void hide(Point* points) const;
  void show(Point* points) const;
  // Gives each copy what its first has.
  void follow(Point* values) const;
  // The same of points, but copies that are held, or whose firsts are, stay where they were.
  void follow(Point* points, const std::uint8_t* held) const;

 private:
  std::vector<Copy> copies_;
  DeviceArray<CopyOnCard> on_card_;
  Context& context_;
};

}  // namespace pointfair::cuda
