// SPDX-License-Identifier: Apache-2.0
// The bytes of a file around its points, as they are written again: all of them, but for records that are taken out or
// put in, and for what the header says: places and numbers that follow from that, the bounds of all points, their
// number, and how many returns they are.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "io/las/grid.hpp"
#include "io/las/header.hpp"

namespace pointfair::io::las {

class Frame {
 public:
  /// `points_end`: where what follows the points begins in the file, `bytes`.
  Frame(std::string_view bytes, const Header& header, std::size_t points_end, std::string name);

  /// Takes the record out.
  void drop(const Record& record);
  /// Puts a record in behind the others before the points, or in the place of the one of this user and number.
  void put_record(std::string_view user, unsigned id, std::string_view description, std::string_view data);

  /// The header and what follows it up to the points, of the form that the points will have.
  std::string front(bool compressed, std::size_t record_length) const;
  /// What follows the points, in pieces.
  const std::vector<std::string_view>& tail() const { return tail_; }
  /// Corrects the places of what follows the points in the header, `front`, once it is known where the tail begins.
  void place_tail(std::string& front, std::uint64_t tail_begin) const;

 private:
  struct Piece {
    std::string user;
    unsigned id;
    std::string bytes;
  };
  std::uint64_t moved(std::size_t old_place, std::uint64_t tail_begin) const;

  std::string_view bytes_;
  const Header& header_;
  std::string name_;
  std::vector<Piece> records_;  // before the points
  bool changed_ = false;        // the number of these is written only then: that of some files is wrong
  std::vector<std::string_view> tail_;
  std::size_t extended_left_ = 0;  // records behind the points
};

/// A variable length record with its head.
std::string make_record(std::string_view user, unsigned id, std::string_view description, std::string_view data);

/// How many points have each return number.
using ReturnCounts = std::array<std::uint64_t, 16>;

/// A bound that is the same as before keeps its bytes in the header, with which `front` begins, unless the file had
/// wrong ones: then all are written.
void put_bounds(const Scaling& scaling, const GridBounds& before, const GridBounds& now, std::string& front);

/// Takes points that are left out off the numbers in the header, with which `front` begins: `points` in all, `gone` of
/// each return. A number that was wrong does not fall below 0.
void take_off_counts(const ReturnCounts& gone, std::uint64_t points, const Header& header, std::string& front);

}  // namespace pointfair::io::las
