// SPDX-License-Identifier: Apache-2.0
// LAZ files that are cut off, damaged, or written to a full disk.
#include <random>
#include <string>
#include <vector>

#include "io/las/laz.hpp"
#include "io_files.h"
#include "laz_oracle.h"

namespace pointfair::test {

namespace las = io::las;

TEST(LazErrors, EveryTruncatedPrefixIsRefused) {
  for (const unsigned format : {1U, 7U}) {
    const std::string laz = make_laz(make_las({.minor = 4, .format = format, .extended = false}), {0, 40, false});
    for (std::size_t size = 0; size + 1 < laz.size(); size += 1 + size / 1000) refusal(laz.substr(0, size), "a.laz");
  }
}

TEST(LazErrors, AFullDiskIsNamedWithTheBytesThatAreNeeded) {
  for (const unsigned format : {1U, 5U, 7U}) {
    const Folder folder;
    put_file(folder / "in.laz", make_laz(make_las({.minor = 4, .format = format, .count = 4000}), {0, 500, false}));
    Cloud cloud = read(folder / "in.laz");
    move_some(cloud);
    const std::string needed = std::to_string(image(cloud, Format::laz).size());
    const Thrown thrown = thrown_with_room_for(20000, [&] { write(folder / "out.laz", cloud); });
    EXPECT_NE(thrown.message.find("needs " + needed + " bytes"), std::string::npos) << thrown.message;
    EXPECT_EQ(folder.names(), std::vector<std::string>{"in.laz"});
  }
}

TEST(LazErrors, DamagedBytesDoNoHarm) {
  std::mt19937 random(7);
  for (const unsigned format : {3U, 5U, 7U, 10U}) {
    const std::string good = make_laz(make_las({.minor = 4, .format = format}), {0, format == 7 ? 0U : 40U, false});
    for (int round = 0; round < 100; ++round) {
      std::string bad = good;
      for (int n = 0; n < 3; ++n)
        bad[las_points_begin(bad) + random() % (bad.size() - las_points_begin(bad))] = static_cast<char>(random());
      try {
        Cloud cloud = parse(bad, "a.laz");
        for (const AttributeInfo& info : attributes(cloud)) attribute(cloud, info.name);
        move_some(cloud);
        image(cloud, Format::laz);
      } catch (const Error& error) {
        EXPECT_EQ(error.kind(), ErrorKind::file) << error.what();
      }
    }
  }
}

// Of many chunks two are decoded at once.
TEST(LazErrors, TheDamagedOneOfManyChunksIsNamed) {
  const std::string laz = make_laz(make_las({.minor = 2, .format = 1, .count = 40 * 1000}), {0, 40, false});
  const las::Header header = las::parse_header(laz, "test");
  const las::Compression compression = las::read_compression(header, "test");
  const auto chunks = las::read_chunk_table(laz, header, compression, "test").chunks;
  ASSERT_EQ(chunks.size(), 1000U);
  for (const std::size_t damaged : {std::size_t{0}, std::size_t{401}, std::size_t{999}}) {
    std::string copy = laz;
    const auto code = static_cast<std::size_t>(chunks[damaged].bytes.data() - laz.data()) + header.record_length;
    const std::size_t length = chunks[damaged].bytes.size() - header.record_length;
    copy.replace(code, length, length, '\xFF');
    const std::string message = thrown_by([&] { parse(copy, "a.laz"); }).message;
    EXPECT_NE(message.find("chunk " + std::to_string(damaged) + " of its points is damaged"), std::string::npos)
        << message;
  }
}

// LASzip's decoder would read outside its tables.
TEST(LazErrors, ACodeThatNoEncoderBeginsWithIsRefused) {
  const auto refused = [](const std::string& bad) {
    return thrown_by([&] {
      const Cloud cloud = parse(bad, "a.laz");
      for (const AttributeInfo& info : attributes(cloud)) attribute(cloud, info.name);
    });
  };
  for (const unsigned format : {4U, 6U, 7U}) {  // whole points by LASzip, layers
    const std::string good = make_laz(make_las({.minor = 4, .format = format, .plain_extra = 2}), {0, 1000, false});
    const std::size_t chunk = las_points_begin(good) + 8, length = las_record_length(good);
    std::vector<std::size_t> codes = {chunk + length};
    if (format >= 6) {
      const std::size_t layers = format == 6 ? 11 : 12;
      std::size_t at = chunk + length + 4 + 4 * layers;
      codes.clear();
      for (std::size_t layer = 0; layer < layers; ++layer) {
        const auto size = las_get<std::uint32_t>(good, chunk + length + 4 + 4 * layer);
        if (size >= 4) codes.push_back(at);
        at += size;
      }
      EXPECT_GT(codes.size(), 9U);
    }
    for (const std::size_t code : codes) {
      std::string bad = good;
      bad.replace(code, 4, 4, '\xFF');
      EXPECT_EQ(refused(bad).kind, ErrorKind::file) << format << ' ' << code;
    }
  }
}

TEST(LazErrors, WhatIsNotKnownIsNamed) {
  const std::string good = make_laz(make_las({}), {});
  const std::size_t record = good.find("laszip encoded") - 2 + 54;
  const auto with = [&](std::size_t at, std::uint16_t value) {
    std::string bad = good;
    las_put(bad, record + at, value);
    return refusal(bad, "a.laz");
  };
  EXPECT_NE(with(0, 4).find("compressor 4"), std::string::npos);
  EXPECT_NE(with(2, 1).find("coder 1"), std::string::npos);
  EXPECT_NE(with(38, 9).find("version 9"), std::string::npos);
  EXPECT_NE(with(36, 21).find("do not agree"), std::string::npos);
  EXPECT_NE(with(32, 900).find("cut off"), std::string::npos);
  std::string interrupted = good;
  las_put<std::uint64_t>(interrupted, las_points_begin(good), las_points_begin(good));
  expect_refused(interrupted, "a.laz", "interrupted");
}

}  // namespace pointfair::test
