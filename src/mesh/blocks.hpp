// SPDX-License-Identifier: Apache-2.0
// Loops, counts and sums over blocks of fixed size, and a sort by numbers, so that no result depends on the number of
// threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "platform/large_vector.hpp"
#include "seam/cloud_sample.hpp"

namespace pointfair {

inline constexpr std::size_t kMeshBlock = 4096;

inline std::size_t mesh_blocks(std::size_t items) { return (items + kMeshBlock - 1) / kMeshBlock; }

// Calls body(first, last, block) for the blocks of `items` items, many at once.
template <class Body>
void for_mesh_blocks(std::size_t items, const ForEach& for_each, const Body& body) {
  for_each(mesh_blocks(items),
           [&](std::size_t block) { body(block * kMeshBlock, std::min(items, (block + 1) * kMeshBlock), block); });
}

// Calls body(i) for each of `items` items, many at once.
template <class Body>
void for_mesh_items(std::size_t items, const ForEach& for_each, const Body& body) {
  for_mesh_blocks(items, for_each, [&](std::size_t first, std::size_t last, std::size_t) {
    for (std::size_t i = first; i < last; ++i) body(i);
  });
}

// How many items i are such that is(i).
template <class Is>
std::uint64_t count_items(std::size_t items, const ForEach& for_each, const Is& is) {
  std::vector<std::uint64_t> counts(mesh_blocks(items));
  for_mesh_blocks(items, for_each, [&](std::size_t first, std::size_t last, std::size_t block) {
    std::uint64_t count = 0;
    for (std::size_t i = first; i < last; ++i) count += is(i);
    counts[block] = count;
  });
  return std::accumulate(counts.begin(), counts.end(), std::uint64_t{0});
}

// Calls place(i, sum of size(j) over all j < i) for each item i, and returns the sum of all.
template <class Size, class Place>
std::size_t place_in_order(std::size_t items, const ForEach& for_each, const Size& size, const Place& place) {
  std::vector<std::size_t> begin(mesh_blocks(items) + 1);
  for_mesh_blocks(items, for_each, [&](std::size_t first, std::size_t last, std::size_t block) {
    std::size_t sum = 0;
    for (std::size_t i = first; i < last; ++i) sum += size(i);
    begin[block + 1] = sum;
  });
  std::partial_sum(begin.begin(), begin.end(), begin.begin());
  for_mesh_blocks(items, for_each, [&](std::size_t first, std::size_t last, std::size_t block) {
    std::size_t sum = begin[block];
    for (std::size_t i = first; i < last; ++i) {
      place(i, sum);
      sum += size(i);
    }
  });
  return begin.back();
}

// Items by their numbers; those of one number in the order in which they came.
template <class Item>
struct ByNumber {
  platform::LargeVector<std::size_t> begin;  // of each number's; one more at the end
  platform::LargeVector<Item> items;

  std::span<Item> of(std::size_t number) { return {items.data() + begin[number], items.data() + begin[number + 1]}; }
};

// A counting sort on many threads: items are first dealt to ranges of numbers, each of which is then small enough for
// its counts to stay in a cache. each(first, last, emit) calls emit(number, item) for what comes from the sources from
// `first` to before `last`, and is called twice.
template <class Item, class Each>
ByNumber<Item> sort_by_number(std::size_t sources, std::size_t numbers, const ForEach& for_each, const Each& each) {
  struct Numbered {
    std::uint32_t number;
    Item item;
  };
  constexpr std::size_t kMostParts = 64, kMostRanges = 256;
  const std::size_t parts = std::min(sources, kMostParts), width = std::max(kMeshBlock, numbers / kMostRanges),
                    ranges = (numbers + width - 1) / width;
  const auto for_part = [&](std::size_t part, const auto& emit) {
    each(sources * part / parts, sources * (part + 1) / parts, emit);
  };
  std::vector<std::size_t> next(parts * ranges), range_begin(ranges + 1);
  for_each(parts, [&](std::size_t part) {
    std::vector<std::size_t> counts(ranges);
    for_part(part, [&](std::uint32_t number, const Item&) { ++counts[number / width]; });
    std::ranges::copy(counts, next.begin() + std::ptrdiff_t(part * ranges));
  });
  std::size_t items = 0;
  for (std::size_t range = 0; range < ranges; ++range) {
    range_begin[range] = items;
    for (std::size_t part = 0; part < parts; ++part) items += std::exchange(next[part * ranges + range], items);
  }
  range_begin[ranges] = items;

  platform::LargeVector<Numbered> dealt(items);
  for_each(parts, [&](std::size_t part) {
    std::size_t* const places = next.data() + part * ranges;
    for_part(part, [&](std::uint32_t number, const Item& item) { dealt[places[number / width]++] = {number, item}; });
  });
  ByNumber<Item> sorted{platform::LargeVector<std::size_t>(numbers + 1), platform::LargeVector<Item>(items)};
  sorted.begin[numbers] = items;
  for_each(ranges, [&](std::size_t range) {
    const std::size_t first = range * width, last = std::min(numbers, first + width);
    const std::span<const Numbered> its(dealt.data() + range_begin[range], dealt.data() + range_begin[range + 1]);
    std::vector<std::size_t> places(last - first + 1);
    for (const Numbered& one : its) ++places[one.number - first + 1];
    places[0] = range_begin[range];
    for (std::size_t i = 1; i < places.size(); ++i) places[i] += places[i - 1];
    std::copy(places.begin(), places.end() - 1, sorted.begin.begin() + std::ptrdiff_t(first));
    for (const Numbered& one : its) sorted.items[places[one.number - first]++] = one.item;
  });
  return sorted;
}

}  // namespace pointfair
