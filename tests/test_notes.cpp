// SPDX-License-Identifier: Apache-2.0
// Notes of what a pack of points met: they say the same positions again, or that there is no note.
#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <random>
#include <vector>

#define POINTFAIR_ISA test_notes
#include "cpu/notes.h"

namespace pointfair::cpu {
namespace {

using test_notes::kLanes;
using test_notes::Note;
using Positions = std::vector<Index>;

// Room for `packs` notes, of which those that say something take at most `bytes`.
struct Book {
  Book(std::size_t bytes, std::size_t packs) : memory(bytes + 2 * packs, 0xee), all{memory.data(), nullptr} {
    all.end = memory.data() + bytes;
  }
  Notes from_front() { return {memory.data(), all.end}; }
  bool write(const Positions& positions) {
    const std::uint8_t* const before = all.next;
    Note::write(all, positions.data(), int(positions.size()));
    return all.next != before + 2;
  }
  std::vector<std::uint8_t> memory;
  Notes all;
};

Positions read(Notes& notes) {
  const Note note(notes);
  std::vector<int> positions(Note::kMostPoints + kLanes);
  if (note.exists()) positions.resize(std::size_t(note.unpack(positions.data())));
  if (!note.exists()) positions.clear();
  return {positions.begin(), positions.end()};
}

// Ascending, by steps of every size up to 2^`bits`.
Positions random_positions(std::mt19937& random, std::size_t count, int bits) {
  Positions positions;
  std::uint64_t at = random() & 0xffff;
  while (positions.size() < count && at < kMaxPoints) {
    positions.push_back(Index(at));
    at += 1 + (random() & ((std::uint64_t(1) << random() % unsigned(bits)) - 1));
  }
  return positions;
}

TEST(Notes, SayWhatWasMet) {
  std::mt19937 random(7);
  std::vector<Positions> written;
  for (const int bits : {1, 4, 9, 20, 28})
    for (const std::size_t count : {1, 2, 15, 16, 17, 200, Note::kMostPoints})
      written.push_back(random_positions(random, count, bits));
  written.push_back({0});
  written.push_back({15, 16, 255 * 16 + 31, 256 * 16 + 31 + 255 * 16, kMaxPoints - 1});  // jumps of 1, 255, 256 leaves
  Book book(1 << 20, written.size());
  for (const Positions& positions : written) EXPECT_TRUE(book.write(positions));
  Notes notes = book.from_front();
  for (const Positions& positions : written) EXPECT_EQ(read(notes), positions);
  EXPECT_EQ(notes.next, book.all.next);
}

TEST(Notes, TakeThreeBytesForALeafThatIsNear) {
  Positions positions;
  for (Index leaf = 100; leaf < 140; ++leaf) positions.push_back(leaf * kLeafSize + leaf % kLeafSize);
  Book book(1 << 10, 1);
  book.write(positions);
  EXPECT_EQ(book.all.next - book.memory.data(), 2 + 4 + 3 * 40);
}

std::ptrdiff_t bytes_of(const Positions& positions) {
  std::ptrdiff_t bytes = 2;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Index leaf = positions[i] / kLeafSize, before = i == 0 ? kMaxPoints : positions[i - 1] / kLeafSize;
    if (leaf != before) bytes += i == 0 || leaf - before > 255 ? 7 : 3;
  }
  return bytes;
}

TEST(Notes, EndBeforeTheirEndAndLeaveRoomForThePacksThatFollow) {
  std::mt19937 random(11);
  int tight = 0;
  for (int bytes = 0; bytes < 600; bytes += 5) {
    constexpr int kPacks = 20;
    Book book(std::size_t(bytes), kPacks);
    std::vector<Positions> kept;
    for (int pack = 0; pack < kPacks; ++pack) {
      const Positions positions = random_positions(random, random() % 12, 12);
      const std::ptrdiff_t left = book.all.end - book.all.next, needed = bytes_of(positions);
      const bool is_kept = book.write(positions);
      EXPECT_TRUE(!is_kept || needed <= left);
      EXPECT_TRUE(is_kept || positions.empty() || needed + 7 > left);
      tight += !positions.empty() && !is_kept;
      ASSERT_LE(book.all.next, book.memory.data() + book.memory.size());
      kept.push_back(is_kept ? positions : Positions{});
    }
    Notes notes = book.from_front();
    for (const Positions& positions : kept) EXPECT_EQ(read(notes), positions);
  }
  EXPECT_GT(tight, 100);
}

}  // namespace
}  // namespace pointfair::cpu
