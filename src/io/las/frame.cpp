// SPDX-License-Identifier: Apache-2.0
#include "io/las/frame.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "io/file_bytes.hpp"

namespace pointfair::io::las {
namespace {

// Whether the header's bounds are numbers and hold all points, up to what rounding the doubles costs.
bool are_right(const Scaling& scaling, const GridBounds& bounds, std::string_view front) {
  constexpr double kRounding = 1e-6;  // of a step
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto max = get<double>(front, place::bounds + 16 * axis),
               min = get<double>(front, place::bounds + 16 * axis + 8);
    const double slack = kRounding * scaling.scale[axis];
    if (!std::isfinite(min) || !std::isfinite(max) || scaling.value(axis, bounds.max[axis]) > max + slack ||
        scaling.value(axis, bounds.min[axis]) < min - slack)
      return false;
  }
  return true;
}

// Takes the points that are gone off a number in the header. One that was wrong does not fall below 0.
template <class T>
void take_off(std::string& front, std::size_t at, std::uint64_t gone) {
  const T before = get<T>(front, at);
  put(front, at, static_cast<T>(before - std::min<std::uint64_t>(before, gone)));
}

}  // namespace

std::string make_record(std::string_view user, unsigned id, std::string_view description, std::string_view data) {
  std::string record;
  append_little<std::uint16_t>(record, 0);
  record.append(user.substr(0, 16)).resize(2 + 16);
  append_little(record, static_cast<std::uint16_t>(id));
  append_little(record, static_cast<std::uint16_t>(data.size()));
  record.append(description.substr(0, 32)).resize(22 + 32);
  return record.append(data);
}

Frame::Frame(std::string_view bytes, const Header& header, std::size_t points_end, std::string name)
    : bytes_(bytes), header_(header), name_(std::move(name)), tail_{bytes.substr(points_end)} {
  for (const Record& record : header.records) {
    if (record.extended) {
      ++extended_left_;
    } else {
      records_.push_back(
          {record.user, record.id, std::string(bytes.substr(record.begin, record.end() - record.begin))});
    }
  }
}

void Frame::drop(const Record& record) {
  if (!record.extended) {
    std::erase_if(records_, [&](const Piece& piece) { return record.is(piece.user, piece.id); });
    changed_ = true;
    return;
  }
  const char* const begin = bytes_.data() + record.begin;
  const char* const end = bytes_.data() + record.end();
  for (std::size_t i = 0; i < tail_.size(); ++i) {
    const std::string_view piece = tail_[i];
    if (begin < piece.data() || end > piece.data() + piece.size()) continue;
    tail_[i] = {piece.data(), static_cast<std::size_t>(begin - piece.data())};
    tail_.insert(tail_.begin() + static_cast<std::ptrdiff_t>(i) + 1,
                 {end, static_cast<std::size_t>(piece.data() + piece.size() - end)});
    --extended_left_;
    return;
  }
}

void Frame::put_record(std::string_view user, unsigned id, std::string_view description, std::string_view data) {
  changed_ = true;
  if (data.size() > std::numeric_limits<std::uint16_t>::max())
    fail(name_, "the descriptions of its attributes no longer fit in one record; write another format");
  Piece made{std::string(user), id, make_record(user, id, description, data)};
  const auto same =
      std::ranges::find_if(records_, [&](const Piece& piece) { return piece.user == user && piece.id == id; });
  if (same == records_.end()) {
    records_.push_back(std::move(made));
  } else {
    *same = std::move(made);
  }
}

std::string Frame::front(bool compressed, std::size_t record_length) const {
  std::string front(bytes_.substr(0, header_.size));
  for (const Piece& piece : records_) front += piece.bytes;
  front += bytes_.substr(header_.records_end, header_.points_begin - header_.records_end);
  if (front.size() > std::numeric_limits<std::uint32_t>::max())
    fail(name_, "what comes before the points no longer fits in 4 GiB");
  put(front, place::points_begin, static_cast<std::uint32_t>(front.size()));
  if (changed_) put(front, place::record_count, static_cast<std::uint32_t>(records_.size()));
  const auto format = get<std::uint8_t>(bytes_, place::point_format);
  put(front, place::point_format, static_cast<std::uint8_t>(compressed ? format | 0x80 : format & ~0x80));
  put(front, place::record_length, static_cast<std::uint16_t>(record_length));
  return front;
}

std::uint64_t Frame::moved(std::size_t old_place, std::uint64_t tail_begin) const {
  const char* const at = bytes_.data() + old_place;
  std::uint64_t before = 0;
  for (const std::string_view piece : tail_) {
    if (at <= piece.data()) break;
    before += std::min<std::uint64_t>(piece.size(), static_cast<std::uint64_t>(at - piece.data()));
  }
  return tail_begin + before;
}

void Frame::place_tail(std::string& front, std::uint64_t tail_begin) const {
  if (header_.waveform_begin != 0) put(front, place::waveform_begin, moved(header_.waveform_begin, tail_begin));
  if (header_.extended_begin == 0) return;
  put(front, place::extended_begin, extended_left_ == 0 ? 0 : moved(header_.extended_begin, tail_begin));
  put(front, place::extended_count, static_cast<std::uint32_t>(extended_left_));
}

void put_bounds(const Scaling& scaling, const GridBounds& before, const GridBounds& now, std::string& front) {
  const bool all = !are_right(scaling, before, front);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t at = place::bounds + 16 * axis;
    if (all || now.max[axis] != before.max[axis]) put(front, at, scaling.value(axis, now.max[axis]));
    if (all || now.min[axis] != before.min[axis]) put(front, at + 8, scaling.value(axis, now.min[axis]));
  }
}

void take_off_counts(const ReturnCounts& gone, std::uint64_t points, const Header& header, std::string& front) {
  constexpr std::size_t kLegacyReturns = 5, kReturns = 15, kFullHeader = 375;
  take_off<std::uint32_t>(front, place::legacy_count, points);
  for (std::size_t r = 0; r < kLegacyReturns; ++r)
    take_off<std::uint32_t>(front, place::legacy_returns + 4 * r, gone[r + 1]);
  if (header.minor < 4 || header.size < kFullHeader) return;
  take_off<std::uint64_t>(front, place::count, points);
  for (std::size_t r = 0; r < kReturns; ++r) take_off<std::uint64_t>(front, place::returns + 8 * r, gone[r + 1]);
}

}  // namespace pointfair::io::las
