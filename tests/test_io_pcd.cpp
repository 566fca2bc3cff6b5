// SPDX-License-Identifier: Apache-2.0
// PCD: its compression, its encodings among each other, organised clouds.
#include <gtest/gtest.h>
// rapidcheck needs GoogleTest before it
#include <rapidcheck/gtest.h>

#include <cmath>

#include "io/lzf.hpp"
#include "io_files.h"
#include "pointfair/file_info.hpp"

namespace pointfair::test {
namespace {

std::string unpacked(const std::string& compressed, std::size_t size) {
  std::string bytes(size, '?');
  EXPECT_TRUE(io::lzf_decompress(compressed, bytes.data(), size));
  return bytes;
}

const Encoding kEncodings[] = {Encoding::ascii, Encoding::binary, Encoding::binary_compressed};

}  // namespace

TEST(FilesPcd, LzfFollowsTheFormat) {
  // Worked by hand: 3 literals, a copy of 3 from 3 back, a long copy of 9 + 5 that overlaps itself.
  EXPECT_EQ(unpacked(std::string("\2abc\x20\2", 6), 6), "abcabc");
  EXPECT_EQ(unpacked(std::string("\0z\xe0\5\0", 5), 15), std::string(15, 'z'));
  std::string to(20, '?');
  for (const std::string& damaged : {std::string("\2ab"), std::string("\x20\0", 2), std::string("\0z\x20\1", 4),
                                     std::string("\0z\xe0\5", 4), std::string("\0z", 2), std::string(60, '\x1f')}) {
    EXPECT_FALSE(io::lzf_decompress(damaged, to.data(), to.size()));
  }
}

RC_GTEST_PROP(FilesPcd, LzfGivesBackWhatWasPacked, (const std::string& seed)) {
  std::string bytes;
  const int pieces = *rc::gen::inRange(0, 40);
  for (int i = 0; i < pieces; ++i) {
    const bool repeat = !bytes.empty() && *rc::gen::inRange(0, 2) == 0;
    if (repeat) {
      const auto from = *rc::gen::inRange<std::size_t>(0, bytes.size());
      bytes += bytes.substr(from, *rc::gen::inRange<std::size_t>(1, 600));
    } else {
      bytes += seed + static_cast<char>(i);
    }
  }
  std::string packed_bytes;
  io::lzf_compress(bytes, packed_bytes);
  RC_ASSERT(unpacked(packed_bytes, bytes.size()) == bytes);
  RC_ASSERT(packed_bytes.size() <= bytes.size() + bytes.size() / 32 + 1);
  // Packed pieces may be joined.
  io::lzf_compress(bytes, packed_bytes);
  RC_ASSERT(unpacked(packed_bytes, 2 * bytes.size()) == bytes + bytes);
}

TEST(FilesPcd, LargeDataIsPackedInPiecesAndRepeatsShrink) {
  Cloud cloud;
  for (int i = 0; i < 300000; ++i) cloud.points.push_back({static_cast<float>(i % 17), 1, std::nanf("")});
  const std::string bytes = image(cloud, Format::pcd, Encoding::binary_compressed);
  EXPECT_LT(bytes.size(), 200000U);
  const Cloud again = parse(bytes, "a.pcd");
  EXPECT_EQ(std::memcmp(again.points.data(), cloud.points.data(), 300000 * sizeof(Point)), 0);
}

// Every encoding into every other: fields, 64-bit integers, WIDTH x HEIGHT, VIEWPOINT and NaN in place.
TEST(FilesPcd, EveryEncodingTurnsIntoEveryOther) {
  for (const Sample& sample : samples()) {
    if (*format_of(sample.name) != Format::pcd || sample.name == "old.pcd") continue;
    const Cloud cloud = parse(sample.bytes, sample.name);
    for (const Encoding encoding : kEncodings) {
      SCOPED_TRACE(sample.name + " to " + std::to_string(static_cast<int>(encoding)));
      const std::string bytes = image(cloud, Format::pcd, encoding);
      EXPECT_NE(bytes.find("WIDTH 2\nHEIGHT 2\nVIEWPOINT 1 2 3 1 0 0 0\nPOINTS 4\n"), std::string::npos);
      const Cloud again = parse(bytes, "b.pcd");
      for (std::size_t i = 0; i < 4; ++i) {
        EXPECT_EQ(std::isnan(again.points[i].x), std::isnan(cloud.points[i].x));
        EXPECT_TRUE(std::isnan(cloud.points[i].x) || again.points[i].z == cloud.points[i].z);
      }
      for (const char* name : {"hist", "t"}) EXPECT_EQ(attribute(again, name).data, attribute(cloud, name).data);
    }
    // A 64-bit integer survives a detour to its last digit.
    const Cloud there = parse(image(cloud, Format::pcd, Encoding::binary_compressed), "b.pcd");
    const std::string back = image(there, Format::pcd, Encoding::ascii);
    const bool ascii = sample.name == "ascii.pcd", binary = sample.name == "binary.pcd";
    EXPECT_EQ(back.find(" 1699999999999999999\n") != std::string::npos, ascii);
    EXPECT_EQ(back.find(" 18446744073709551615\n") != std::string::npos, binary);
  }
}

TEST(FilesPcd, PackedColorsAndNormalsTurnIntoThoseOfPlyAndBack) {
  const std::string pcd =
      "FIELDS x y z rgb normal_x normal_y normal_z\nSIZE 4 4 4 4 4 4 4\nTYPE F F F U F F F\n"
      "COUNT 1 1 1 1 1 1 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\n"
      "1 2 3 16711935 0 0 1\n4 5 6 66051 0 1 0\n";  // 0xff00ff, 0x010203
  const Cloud ply = parse(image(parse(pcd, "a.pcd"), Format::ply));
  EXPECT_EQ(values<std::uint8_t>(ply, "red"), (std::vector<std::uint8_t>{255, 1}));
  EXPECT_EQ(values<std::uint8_t>(ply, "green"), (std::vector<std::uint8_t>{0, 2}));
  EXPECT_EQ(values<std::uint8_t>(ply, "blue"), (std::vector<std::uint8_t>{255, 3}));
  EXPECT_EQ(values<float>(ply, "nz"), (std::vector<float>{1, 0}));
  const Cloud back = parse(image(ply, Format::pcd), "b.pcd");
  EXPECT_EQ(values<std::uint32_t>(back, "rgb"), (std::vector<std::uint32_t>{16711935, 66051}));
  EXPECT_EQ(values<float>(back, "normal_y"), (std::vector<float>{0, 1}));
}

// Depth cameras and lidars write (0, 0, 0) where they measured nothing, or NaN.
TEST(FilesPcd, EmptyPixelsAreInvalidAndKeepTheirBytes) {
  const std::string fields = "FIELDS x y z i\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n";
  const std::string rows = "0 0 0 7\n1 0 2 7\n0 1 2 7\n-0 0 0 7\n1 1 2 7\n2 1 2 7\n";
  for (const char* size : {"WIDTH 3\nHEIGHT 2\n", "WIDTH 6\nHEIGHT 1\n"}) {
    const Cloud text = parse("VERSION 0.7\n" + fields + size + "POINTS 6\nDATA ascii\n" + rows, "a.pcd");
    for (const Encoding encoding : kEncodings) {
      const std::string bytes = image(text, Format::pcd, encoding);
      Cloud cloud = parse(bytes, "a.pcd");
      for (std::size_t i = 0; i < 6; ++i) EXPECT_EQ(std::isnan(cloud.points[i].x), i % 3 == 0) << i;
      EXPECT_EQ(image(cloud, Format::pcd, encoding), bytes);
      EXPECT_EQ(image(cloud, Format::xyz).substr(0, 6), "0 0 0 ");
      EXPECT_EQ(parse(image(cloud, Format::las), "a.las").points.size(), 6U);  // where NaN is refused
      cloud.points[1].z = 2.5F;
      const Cloud moved = parse(image(cloud, Format::pcd, encoding), "a.pcd");
      EXPECT_EQ(moved.points[1].z, 2.5F);
      EXPECT_TRUE(std::isnan(moved.points[0].x));
    }
  }
}

TEST(FilesPcd, AnOrganisedFileTellsItsGridUntilPointsAreRemoved) {
  const std::string head = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n", data = "DATA ascii\n";
  const std::string rows = "0 0 1\n1 0 1\n2 0 1\nnan nan nan\n1 1 1\n2 1 1\n";
  const auto grid_of = [](const Cloud& cloud) {
    const FileInfo info = file_info(cloud);
    return std::pair(info.grid_width, info.grid_height);
  };
  using Grid = std::pair<std::uint64_t, std::uint64_t>;
  const Cloud cloud = parse(head + "WIDTH 3\nHEIGHT 2\nPOINTS 6\n" + data + rows, "a.pcd");
  EXPECT_EQ(grid_of(cloud), Grid(3, 2));
  EXPECT_EQ(grid_of(parse(image(cloud, Format::pcd, Encoding::binary), "b.pcd")), Grid(3, 2));
  EXPECT_EQ(grid_of(parse(image(cloud, Format::ply))), Grid(0, 0));
  EXPECT_EQ(grid_of(without_points(cloud, std::vector<std::uint8_t>{0, 1, 0, 0, 0, 0})), Grid(0, 0));
  EXPECT_EQ(grid_of(parse(head + "WIDTH 6\nHEIGHT 1\nPOINTS 6\n" + data + rows, "c.pcd")), Grid(0, 0));
}

TEST(FilesPcd, ATypeThatIsNotKnownIsRefusedWithTheNextStep) {
  expect_refused(
      "FIELDS x y z i\nSIZE 4 4 4 2\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 1\nHEIGHT 1\nPOINTS 1\nDATA ascii\n0 0 0 1\n",
      "a.pcd", "the field 'i' has a TYPE and SIZE that PCD does not know; save it as another type, such as F 4");
}

}  // namespace pointfair::test
