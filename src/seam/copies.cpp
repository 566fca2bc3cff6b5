// SPDX-License-Identifier: Apache-2.0
#include "seam/copies.hpp"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <tuple>
#include <utility>

#include "seam/cloud_sample.hpp"
#include "seam/stop.hpp"

namespace pointfair {
namespace {

// A valid point in its cell. Those of a cell are in the order in which they come first.
struct Entry {
  std::uint64_t cell;
  std::uint32_t order, point;
};

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

std::uint64_t cell_at(double x, double y, double z) {
  std::uint64_t hash = 0x9e3779b97f4a7c15u;
  for (const double word : {x, y, z}) {
    hash = (hash ^ point::bits_of(word)) * 0xff51afd7ed558ccdu;
    hash ^= hash >> 32;
  }
  return hash;
}

bool comes_before(std::span<const Point> points, const Entry& a, const Entry& b) {
  if (a.order != b.order) return a.order < b.order;
  const Point &p = points[a.point], &q = points[b.point];
  return std::tie(p.x, p.y, p.z, a.point) < std::tie(q.x, q.y, q.z, b.point);
}

// Cells are hashes, so their first bits deal entries out to buckets of some hundreds, each of which is sorted: all of
// it at once by many threads, where a sort of the whole begins with serial passes.
void sort_by_cells(std::span<const Point> points, std::vector<Entry>& entries) {
  constexpr std::size_t kOfBucket = 256, kMany = 4096, kMostBits = 12, kParts = 32;
  const auto less = [points](const Entry& a, const Entry& b) {
    return a.cell != b.cell ? a.cell < b.cell : comes_before(points, a, b);
  };
  const std::size_t bits = std::min(std::size_t(std::bit_width(entries.size() / kOfBucket)), kMostBits);
  const std::size_t buckets = std::size_t(1) << bits;
  const auto bucket_of = [bits](const Entry& e) { return bits > 0 ? std::size_t(e.cell >> (64 - bits)) : 0; };
  const auto for_part = [&entries](std::size_t part, const auto& visit) {
    const std::size_t end = (part + 1) * entries.size() / kParts;
    for (std::size_t e = part * entries.size() / kParts; e < end; ++e) visit(entries[e]);
  };
  std::vector<std::uint32_t> place(kParts * buckets);  // of each part's next entry in each bucket
  tbb::parallel_for(std::size_t(0), kParts, [&](std::size_t part) {
    for_part(part, [&](const Entry& e) { ++place[part * buckets + bucket_of(e)]; });
  });
  std::vector<std::uint32_t> begins{0};
  for (std::size_t bucket = 0; bucket < buckets; ++bucket) {
    std::uint32_t next = begins.back();
    for (std::size_t part = 0; part < kParts; ++part) {
      std::uint32_t& its = place[part * buckets + bucket];
      next += std::exchange(its, next);
    }
    begins.push_back(next);
  }
  std::vector<Entry> dealt(entries.size());
  tbb::parallel_for(std::size_t(0), kParts, [&](std::size_t part) {
    for_part(part, [&](const Entry& e) { dealt[place[part * buckets + bucket_of(e)]++] = e; });
  });
  entries.swap(dealt);
  tbb::parallel_for(std::size_t(0), buckets, [&](std::size_t bucket) {
    const auto first = entries.begin() + begins[bucket], end = entries.begin() + begins[bucket + 1];
    if (std::size_t(end - first) > kMany)  // many at one place, or very many in all
      tbb::parallel_sort(first, end, less);
    else
      std::sort(first, end, less);
  });
}

std::uint64_t cell_of(const Point& p) { return cell_at(p.x, p.y, p.z); }

// One entry for each of the points that are valid.
std::vector<Entry> all_valid(std::span<const Point> points) {
  std::vector<Entry> entries;
  entries.reserve(points.size());
  for (std::uint32_t i = 0; i < points.size(); ++i)
    if (is_indexed(points[i])) entries.push_back({0, 0, i});
  return entries;
}

// Of these, those whose place may be another one's, too: all that are, and one of thirty others, which share a bit of
// their hash with one. Sorting all takes five times as long.
std::vector<Entry> not_alone(std::span<const Point> points, std::vector<Entry> entries) {
  const std::size_t words = std::bit_ceil(entries.size() + 1);  // 32 to 64 bits for each
  std::vector<std::atomic<std::uint32_t>> once(words), twice(words);
  const auto word_of = [words](std::uint64_t cell) { return std::size_t(cell >> 5) & (words - 1); };
  const auto bit_of = [](std::uint64_t cell) { return std::uint32_t(1) << (cell & 31); };
  tbb::parallel_for(std::size_t(0), entries.size(), [&](std::size_t e) {
    const std::uint64_t cell = entries[e].cell = cell_of(points[entries[e].point]);
    if (once[word_of(cell)].fetch_or(bit_of(cell), std::memory_order_relaxed) & bit_of(cell))
      twice[word_of(cell)].fetch_or(bit_of(cell), std::memory_order_relaxed);
  });
  std::erase_if(entries, [&](const Entry& e) { return (twice[word_of(e.cell)] & bit_of(e.cell)) == 0; });
  return entries;
}

// Those of a cell after each other: at one place, or in a cube so small that all of it are within the rule's distance
// of each other.
void sort_by_rule(std::span<const Point> points, const CopyRule& rule, std::vector<Entry>& entries) {
  const double side = rule.within / 2;
  tbb::parallel_for(std::size_t(0), entries.size(), [&](std::size_t e) {
    const Point& p = points[entries[e].point];
    const auto off = point::exact_offset(to_vec3(p), to_vec3(rule.corner));
    entries[e].cell =
        side > 0 ? cell_at(std::floor(off.x / side), std::floor(off.y / side), std::floor(off.z / side)) : cell_of(p);
    entries[e].order = point::position_hash(to_vec3(p), to_vec3(rule.corner));
  });
  sort_by_cells(points, entries);
}

bool are_close(const Point& p, const Point& q, double within) {
  const auto off = point::exact_offset(to_vec3(p), to_vec3(q));
  return off.x * off.x + off.y * off.y + off.z * off.z <= within * within;
}

// Leaves the first of those that follow each other in a cell and are close to it; it is `before` the others.
void keep_firsts(std::span<const Point> points, double within, std::vector<Entry>& entries,
                 std::vector<std::uint32_t>& before) {
  constexpr std::size_t kParts = 32;
  std::array<std::size_t, kParts + 1> begins{};  // of parts that share no cell
  for (std::size_t part = 1; part <= kParts; ++part) {
    std::size_t& begin = begins[part] = std::max(begins[part - 1], part * entries.size() / kParts);
    while (begin > 0 && begin < entries.size() && entries[begin].cell == entries[begin - 1].cell) ++begin;
  }
  std::array<std::size_t, kParts> ends{};  // of what each keeps
  tbb::parallel_for(std::size_t(0), kParts, [&](std::size_t part) {
    std::size_t end = begins[part];
    for (std::size_t e = begins[part]; e < begins[part + 1]; ++e) {
      const Entry entry = entries[e];
      const bool follows = end > begins[part] && entries[end - 1].cell == entry.cell &&
                           are_close(points[entries[end - 1].point], points[entry.point], within);
      if (follows)
        before[entry.point] = entries[end - 1].point;
      else
        entries[end++] = entry;
    }
    ends[part] = end;
  });
  auto kept = entries.begin();
  for (std::size_t part = 0; part < kParts; ++part)
    kept =
        std::copy(entries.begin() + std::ptrdiff_t(begins[part]), entries.begin() + std::ptrdiff_t(ends[part]), kept);
  entries.erase(kept, entries.end());
}

// Places in cells twice as wide as a distance, so that what lies within it of one of them is in eight cells. Of the
// cells of sort_by_rule() they have one place each, so few share a cell.
class Neighborhood {
 public:
  Neighborhood(std::span<const Point> points, std::vector<Entry> entries, double within)
      : points_(points), entries_(std::move(entries)), within_(within) {
    tbb::parallel_for(std::size_t(0), entries_.size(), [&](std::size_t e) {
      const Point& p = points_[entries_[e].point];
      entries_[e].cell = cell_at(step(p.x), step(p.y), step(p.z));
    });
    sort_by_cells(points_, entries_);
    make_table();
  }

  std::span<const Entry> entries() const { return entries_; }

  // Of the entries within the distance the one that comes first, which may be itself.
  std::uint32_t first_around(std::uint32_t entry) const {
    const Point& p = points_[entries_[entry].point];
    std::uint32_t first = entry;
    for (int corner = 0; corner < 8; ++corner) {
      const std::uint64_t cell =
          cell_at(step(p.x) + (corner & 1 ? aside(p.x) : 0.0), step(p.y) + (corner & 2 ? aside(p.y) : 0.0),
                  step(p.z) + (corner & 4 ? aside(p.z) : 0.0));
      for (std::uint32_t e = begin_of(cell); e < entries_.size() && entries_[e].cell == cell; ++e) {
        if (!comes_before(points_, entries_[e], entries_[first])) break;
        if (!are_close(points_[entries_[e].point], p, within_)) continue;
        first = e;
        break;
      }
    }
    return first;
  }

 private:
  double step(float at) const { return std::floor(at / (2 * within_)); }
  // To the nearer of the cells beside.
  double aside(float at) const { return at / (2 * within_) - step(at) < 0.5 ? -1.0 : 1.0; }
  // Where each cell begins, by open addressing.
  void make_table() {
    const auto begins = [this](std::size_t e) { return e == 0 || entries_[e].cell != entries_[e - 1].cell; };
    std::size_t cells = 0;
    for (std::size_t e = 0; e < entries_.size(); ++e) cells += begins(e);
    table_.assign(std::bit_ceil(2 * cells + 1), kNone);
    for (std::uint32_t e = 0; e < entries_.size(); ++e)
      if (begins(e)) table_[slot_of(entries_[e].cell)] = e;
  }
  std::uint32_t begin_of(std::uint64_t cell) const { return table_[slot_of(cell)]; }
  std::size_t slot_of(std::uint64_t cell) const {
    std::size_t slot = std::size_t(cell) & (table_.size() - 1);
    while (table_[slot] != kNone && entries_[table_[slot]].cell != cell) slot = (slot + 1) & (table_.size() - 1);
    return slot;
  }

  std::span<const Point> points_;
  std::vector<Entry> entries_;
  double within_;
  std::vector<std::uint32_t> table_;
};

// The points that follow another one, ascending. Those in the region `sure` and their firsts there are sure.
std::vector<Copy> all_that_follow(std::span<const Point> points, const std::vector<std::uint32_t>& before,
                                  const point::Region& sure) {
  constexpr std::size_t kParts = 32;
  std::array<std::vector<Copy>, kParts> of_part;
  tbb::parallel_for(std::size_t(0), kParts, [&](std::size_t part) {
    const auto end = std::uint32_t((part + 1) * points.size() / kParts);
    for (auto i = std::uint32_t(part * points.size() / kParts); i < end; ++i) {
      if (before[i] == i) continue;
      Copy copy{i, i, points[i], point::is_inside(sure, to_vec3(points[i]))};
      while (before[copy.first] != copy.first) {
        copy.first = before[copy.first];
        copy.is_sure = copy.is_sure && point::is_inside(sure, to_vec3(points[copy.first]));
      }
      of_part[part].push_back(copy);
    }
  });
  std::vector<Copy> copies;
  for (const std::vector<Copy>& its : of_part) copies.insert(copies.end(), its.begin(), its.end());
  return copies;
}

// Null: none.
const Copy* find(std::span<const Copy> copies, std::uint32_t point) {
  const auto found = std::ranges::lower_bound(copies, point, {}, &Copy::point);
  return found != copies.end() && found->point == point ? &*found : nullptr;
}

}  // namespace

point::Region without_border(point::Region region, const CopyRule& rule) {
  if (!(rule.within > 0)) return region;
  const auto inwards = [&](float end, int sign) {
    return std::nextafter(float(end + sign * reach_of_decision(rule)), float(sign) * kUnbounded);
  };
  return {{inwards(region.min.x, 1), inwards(region.min.y, 1), inwards(region.min.z, 1)},
          {inwards(region.max.x, -1), inwards(region.max.y, -1), inwards(region.max.z, -1)}};
}

std::vector<Copy> copies_among(std::span<const Point> points, const CopyRule& rule, const point::Region& loaded,
                               const std::stop_token& stop) {
  std::vector<std::uint32_t> before(points.size());  // the point that each follows, or itself
  std::iota(before.begin(), before.end(), 0u);
  std::vector<Entry> entries = all_valid(points);
  if (rule.within <= 0) entries = not_alone(points, std::move(entries));
  sort_by_rule(points, rule, entries);
  keep_firsts(points, std::max(rule.within, 0.0), entries, before);
  throw_if_stopped(stop);
  if (rule.within > 0) {
    const Neighborhood near(points, std::move(entries), rule.within);
    const std::span<const Entry> firsts = near.entries();
    tbb::parallel_for(std::size_t(0), firsts.size(), [&](std::size_t e) {
      before[firsts[e].point] = firsts[near.first_around(std::uint32_t(e))].point;
    });
  }
  return all_that_follow(points, before, without_border(loaded, rule));
}

std::vector<Copy> copies_at_one_place(std::span<const Point> points, std::span<const std::uint32_t> known) {
  std::vector<Copy> copies;
  std::vector<bool> is_known(points.size());
  for (const std::uint32_t i : known) {
    if (!is_indexed(points[i])) continue;
    copies.push_back({i, kNone, points[i]});
    is_known[i] = true;
  }
  const auto less = [](const Point& a, const Point& b) { return point::lies_before(to_vec3(a), to_vec3(b)); };
  std::ranges::sort(copies, less, &Copy::place);
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    if (is_known[i] || !is_indexed(points[i])) continue;
    for (Copy& copy : std::ranges::equal_range(copies, points[i], less, &Copy::place))
      copy.first = std::min(copy.first, i);
  }
  for (auto begin = copies.begin(); begin != copies.end();) {
    const auto end = std::ranges::upper_bound(begin, copies.end(), begin->place, less, &Copy::place);
    if (begin->first == kNone) {  // and so are all of its place
      const std::uint32_t first = std::ranges::min_element(begin, end, {}, &Copy::point)->point;
      for (; begin != end; ++begin)
        if (begin->point != first) begin->first = first;
    }
    begin = end;
  }
  std::erase_if(copies, [](const Copy& copy) { return copy.first == kNone; });
  std::ranges::sort(copies, {}, &Copy::point);
  return copies;
}

std::uint32_t first_of(std::span<const Copy> copies, std::uint32_t point) {
  const Copy* const copy = find(copies, point);
  return copy != nullptr ? copy->first : point;
}

bool is_sure(std::span<const Copy> copies, std::uint32_t point) {
  const Copy* const copy = find(copies, point);
  return copy == nullptr || copy->is_sure;
}

CloudSample once_each(const CloudSample& sample, std::span<const std::uint32_t> firsts, std::span<const Point> places,
                      double times) {
  CloudSample once{sample.bounds, {}, {}};
  once.bounds.valid = std::uint64_t(std::llround(double(sample.bounds.valid) / times));
  std::vector<std::size_t> by_place(places.size());
  for (std::size_t i = 0; i < by_place.size(); ++i) by_place[i] = i;
  std::ranges::stable_sort(by_place, [&](std::size_t a, std::size_t b) {
    return point::lies_before(to_vec3(places[a]), to_vec3(places[b]));
  });
  std::vector<bool> is_new(places.size(), true);
  for (std::size_t i = 1; i < by_place.size(); ++i)
    is_new[by_place[i]] = point::lies_before(to_vec3(places[by_place[i - 1]]), to_vec3(places[by_place[i]]));
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (!is_new[i]) continue;
    once.points.push_back(places[i]);
    once.indices.push_back(firsts[i]);
  }
  return once;
}

}  // namespace pointfair
