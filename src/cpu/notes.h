// SPDX-License-Identifier: Apache-2.0
// Notes of what walks within a radius met, so that later walks of the same packs need not search. Part of
// src/cpu/kernels.cpp.
#pragma once

#include "cpu/kernels.h"
#include "cpu/pack.h"

namespace pointfair::cpu::POINTFAIR_ISA {

// One pack's note: how many bytes follow, 0 where there is no note; then of each leaf, in order, how far it lies behind
// the one before, and a bit for each of its points that the pack met. A leaf that lies farther than a byte can say, as
// the first one, has a zero there, and its number follows.
class Note {
 public:
  static constexpr int kMostPoints = 1024;

  // The next one; `notes` then names the one after it.
  POINTFAIR_INLINE explicit Note(Notes& notes) {
    Bytes bytes;
    begin_ = read(notes.next, bytes);
    end_ = begin_ + bytes;
    notes.next += end_ - notes.next;
  }
  POINTFAIR_INLINE bool exists() const { return end_ != begin_; }

  // The sorted positions of the points, in order, and how many they are. There must be room for a pack more.
  POINTFAIR_INLINE int unpack(int* positions) const {
    int count = 0;
    Index leaf = 0;
    for (const std::uint8_t* at = begin_; at != end_;) {
      const Jump jump = *at++;
      if (jump != 0) {
        leaf += jump;
      } else {
        at = read(at, leaf);
      }
      Points points;
      at = read(at, points);
      for (int c = 0; c < kLeafSize; c += kLanes)
        count += append_lanes(positions + count, int(leaf) * kLeafSize + c, points >> c & ((1u << kLanes) - 1));
    }
    return count;
  }

  // Writes that of the `count` ascending positions; none if there are none, or if it would not end before that of
  // `notes`.
  static void write(Notes& notes, const Index* positions, int count) {
    const std::uint8_t* const last = notes.end - kLargestEntry;
    std::uint8_t* const begin = notes.next + sizeof(Bytes);
    std::uint8_t* at = begin;
    bool fits = count > 0;
    Index before = 0;
    for (int i = 0; i < count && fits;) {
      const Index leaf = positions[i] / kLeafSize, jump = i == 0 ? 0 : leaf - before;
      Points points = 0;
      for (; i < count && positions[i] / kLeafSize == leaf; ++i) points |= Points(1u << positions[i] % kLeafSize);
      fits = at <= last;
      if (fits) at = write_entry(at, leaf, jump, points);
      before = leaf;
    }
    write(notes.next, Bytes(fits ? at - begin : 0));
    notes.next = fits ? at : begin;
  }

 private:
  using Bytes = std::uint16_t;
  using Jump = std::uint8_t;
  using Points = std::uint16_t;
  static_assert(8 * sizeof(Points) == kLeafSize);
  static constexpr int kLargestEntry = sizeof(Jump) + sizeof(Index) + sizeof(Points);
  static_assert(sizeof(Bytes) * kLeafSize <= kBytesOfNoNotes * kLanes);

  template <class T>
  static POINTFAIR_INLINE const std::uint8_t* read(const std::uint8_t* from, T& value) {
    __builtin_memcpy(&value, from, sizeof value);
    return from + sizeof value;
  }
  template <class T>
  static POINTFAIR_INLINE std::uint8_t* write(std::uint8_t* to, T value) {
    __builtin_memcpy(to, &value, sizeof value);
    return to + sizeof value;
  }
  static POINTFAIR_INLINE std::uint8_t* write_entry(std::uint8_t* to, Index leaf, Index jump, Points points) {
    if (jump != 0 && jump <= 0xff) {
      to = write(to, Jump(jump));
    } else {
      to = write(write(to, Jump(0)), leaf);
    }
    return write(to, points);
  }

  const std::uint8_t *begin_, *end_;
};

}  // namespace pointfair::cpu::POINTFAIR_ISA
