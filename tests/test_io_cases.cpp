// SPDX-License-Identifier: Apache-2.0
// Files as people and other programs write them.
#include <cmath>

#include "io/source.hpp"
#include "io_variants.h"
#include "las_files.h"

namespace pointfair::test {
namespace {

// Blanks for commas, and no names where there are coordinates only.
std::string as_txt(const std::string& csv) {
  const std::string text = replaced(csv, ",", " ");
  return text.starts_with("x y z\n") ? text.substr(6) : text;
}

std::string cut(const std::string& text) { return text.substr(0, 160); }

}  // namespace

TEST(FilesCases, EveryKindIsReadRight) {
  for (const Given& given : all_files()) {
    SCOPED_TRACE(given.name + ": " + cut(given.bytes));
    const Cloud cloud = parse(given.bytes, given.name);
    // in a format of another family, so that the file is written anew
    if (given.name.ends_with(".csv")) {
      EXPECT_EQ(image(cloud, Format::txt), as_txt(given.csv));
    } else {
      EXPECT_EQ(image(cloud, Format::csv), given.csv);
    }
  }
}

TEST(FilesCases, ACopyKeepsEveryByte) {
  for (const Given& given : all_files()) {
    SCOPED_TRACE(given.name + ": " + cut(given.bytes));
    const Cloud cloud = parse(given.bytes, given.name);
    EXPECT_EQ(image(cloud, cloud.source->format()), given.bytes);
  }
}

TEST(FilesCases, AMovedPointIsReadWhereItWent) {
  for (const Given& given : all_files()) {
    SCOPED_TRACE(given.name + ": " + cut(given.bytes));
    Cloud cloud = parse(given.bytes, given.name);
    Point& last = cloud.points.back();
    last.y += 0.5F;
    const Cloud again = parse(image(cloud, cloud.source->format()), given.name);
    ASSERT_EQ(again.points.size(), cloud.points.size());
    if (std::isfinite(last.y)) {
      EXPECT_EQ(again.origin[1] + again.points.back().y, cloud.origin[1] + last.y);
    }
    EXPECT_EQ(std::memcmp(&again.points.front(), &cloud.points.front(), sizeof(float)), 0);
    for (const AttributeInfo& info : attributes(cloud))
      EXPECT_EQ(attribute(again, info.name).data, attribute(cloud, info.name).data);
  }
}

TEST(FilesCases, WhatIsLostIsTold) {
  for (const Given& given : all_files()) {
    if (given.lost.empty()) continue;
    std::string notes;
    for (const std::string& note : losses(parse(given.bytes, given.name), given.other)) notes += note + "\n";
    EXPECT_NE(notes.find(given.lost), std::string::npos) << given.name << ": " << notes;
  }
}

TEST(FilesCases, DecimalCommasAndQuotesStay) {
  Cloud commas = parse("x;y;z;i\n1,5;2;3;7\n4;5,25;6;8\n", "a.csv");
  commas.points[1].y = 5.5F;
  commas.added = {make_attribute<float>("n", ScalarType::float32, {0.5F, 1})};
  EXPECT_EQ(image(commas, Format::csv), "x;y;z;i;n\n1,5;2;3;7;0,5\n4;5,50;6;8;1\n");
  Cloud quotes = parse("\"x\",\"y\",\"z\"\n\"1.5\",\"2\",\"3\"\n", "a.csv");
  quotes.points[0].y = 2.5F;
  EXPECT_EQ(image(quotes, Format::csv), "\"x\",\"y\",\"z\"\n\"1.5\",\"2.5\",\"3\"\n");
}

// Found by the fuzzer, as "8;;\r".
TEST(FilesCases, WhatIsMissingAtTheEndOfALineIsWrittenThere) {
  Cloud cloud = parse("x;y;z\r\n8;9;\r\n4;5;6\r\n", "a.csv");
  cloud.points[0].z = 7;
  cloud.added = {make_attribute<std::uint8_t>("n", ScalarType::uint8, {1, 2})};
  EXPECT_EQ(image(cloud, Format::csv), "x;y;z;n\r\n8;9;7;1\r\n4;5;6;2\r\n");
}

// Found by the fuzzer: words that moved had the decimal sign of another row, and were taken for two.
TEST(FilesCases, AWordThatMovedKeepsItsDecimalSign) {
  Cloud cloud = parse("1.5\t2\t3\t0\n4\t4\t1,5\t0\n", "a.txt");
  cloud.points[0].x = 2.5F;
  cloud.points[1].z = 2.5F;
  EXPECT_EQ(image(cloud, Format::txt), "2.5\t2\t3\t0\n4\t4\t2,5\t0\n");
}

// Found by the fuzzer: with one more name, a line that passed for a title had as many words as there are names.
TEST(FilesCases, NoColumnIsAddedWhereLinesMightPassForRows) {
  for (const char* text : {"x\ty\tz\tname\ti\n1.52\t\t3\toak\toak\t7\n4\t5.25\t6\tash\t8\n",
                           "x\ty\tz\ti\n\t4\t5.25\t=\tash\n1.5\t2\t3\t7\n"}) {
    Cloud cloud = parse(text, "a.csv");
    EXPECT_EQ(image(cloud, Format::csv), text);
    cloud.added = {
        make_attribute<std::uint8_t>("n", ScalarType::uint8, std::vector<std::uint8_t>(cloud.points.size()))};
    expect_error(ErrorKind::file, "so no column is added", [&] { image(cloud, Format::csv); });
  }
}

TEST(FilesCases, NegativeZeroStays) {
  for (const char* zero : {"-0.0000", "-0", "-0.0e0"}) {
    Cloud cloud = parse(std::string(zero) + " 2.5 3\n1 2 3\n", "a.txt");
    cloud.points[0].x = 0;
    cloud.points[1].x = 2;
    EXPECT_EQ(image(cloud, Format::txt), std::string(zero) + " 2.5 3\n2 2 3\n");
  }
}

TEST(FilesCases, WhatIsMeantIsSaidWhereAFileIsRefused) {
  const Bad all[] = {
      {"a.csv", "A,B,C\n1,2,3\n",
       "no column is called 'x', there are 'A', 'B', 'C'; say what the columns are, as in --columns"},
      {"a.csv", "id,east,north\n1,2,3\n", "no column is called 'z', there are 'id', 'east', 'north'"},
      {"a.csv", "lon,lat,h\n1,2,3\n", "no column is called 'x', there are 'lon', 'lat', 'h'"},
      {"a.pts", "1\n1 2 3\n2\n4 5 6\n", "lines of one number promise 3 points, file holds 2"},
      {"a.pts", "2\n1 2 3\n4 5 6\n7\n", "promise 9 points, file holds 2"},
      {"a.off", "OFF\n2 1 0\n1 2 3 4 5 6\n", "a face needs a count"},
      {"a.ply", ply("property float16 x\n", ""), "with the types of PLY, not 'float16'"},
      {"a.ply", ply(kXyz, "1 2 3 4 5\n"), "header promises 2 points, file ends after 1"},
      {"a.pcd", "FIELDS a b c\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n",
       "no field 'x', there are 'a', 'b', 'c'"},
      {"a.xyz.gz", "\x1F\x8B\x08 packed", "is packed by gzip"},
      {"a.xyz", "PK\x03\x04 packed", "is a ZIP archive"},
      {"a.ply", "version https://git-lfs.github.com/spec/v1\noid sha256:1\n", "Git LFS"},
      {"a.csv", "x,y,z\n1,2,3\nx,y,z\n4,5,6\n", "line 3: 'x' is not a number"},
      // first rows that would pass for titles
      {"a.csv", "x,y,z\n\"1,234.5\",\"2\",\"3\"\n4,5,6\n",
       "line 2: '1,234.5' is not a number; export numbers with a decimal point, and thousands without separators"},
      {"a.csv", "x,y,z\n1,2,3 # first\n4,5,6\n", "line 2: '3 # first' is not a number"},
      {"a.csv", "x,y,z\n***,***,***\n4,5,6\n", "line 2: '***' is not a number"},
      {"a.csv", "x,y,z\n-,-,-\n4,5,6\n", "line 2: '-' is not a number"},
      {"a.txt", "0x1.8p0 2 3\n4 5 6\n", "line 1: '0x1.8p0' is not a number"},
  };
  for (const Bad& bad : all) expect_refused(bad.bytes, bad.name, bad.message);
}

// Of point i the columns i + first, 2.5 i, 3.5, 4.5.
std::string numbered(int rows, int first, int step = 1) {
  std::string text;
  for (int i = 0; i < rows; ++i)
    text += std::to_string(first + step * i) + "," + std::to_string(2.5 * i) + ",3.5,4.5\n";
  return text;
}

TEST(FilesCases, NumbersOfPointsAreNoCoordinates) {
  constexpr const char* kWhy = "the first column numbers the points, so it is no coordinate; name the columns";
  expect_refused(numbered(8, 0), "a.csv", kWhy);
  expect_refused(numbered(20000, 1001, 2), "a.txt", kWhy);
  std::string spaced = numbered(30, 7);
  std::replace(spaced.begin(), spaced.end(), ',', ' ');
  expect_refused(spaced, "a.xyz", kWhy);
  const auto first_x = [](const std::string& text) { return parse(text, "a.csv").points.at(0).x; };
  EXPECT_EQ(first_x(numbered(7, 1)), 1) << "too few to tell";
  EXPECT_EQ(first_x(numbered(8, 9, -1)), 9) << "they do not grow";
  EXPECT_EQ(first_x("id,x,y,z\n" + numbered(8, 1)), 0) << "named";
  std::string grid;  // its rows run along x
  for (int i = 0; i < 50; ++i) grid += std::to_string(i) + ",0,3.5,12\n";
  EXPECT_EQ(parse(grid, "a.csv").points.at(49).x, 49);
  const std::string nine = numbered(9, 1);
  const ReadOptions names{.columns = {"id", "x", "y", "z"}};
  EXPECT_EQ(read(std::as_bytes(std::span(nine)), "a.csv", names).points[1].x, 2.5f);
}

TEST(FilesCases, Utf16IsNamed) {
  for (const std::string& front : {std::string("\xFF\xFE", 2), std::string("\xFE\xFF", 2)})
    for (const char* name : {"a.csv", "a.ply", "a.obj", "a.asc", "a.txt"}) {
      expect_refused(front + std::string("v\0 \0", 4), name, "is text in UTF-16; convert it to UTF-8");
    }
}

TEST(FilesCases, OptionsSayWhatTheColumnsAre) {
  const auto read_with = [](const std::string& text, ReadOptions options, const std::string& name = "a.csv") {
    return read(std::as_bytes(std::span(text)), name, options);
  };
  ReadOptions named{.columns = {"i", "y", "x", "z"}};
  const Cloud cloud = read_with("A,B,C,D\n7,2,1,3\n", named);
  EXPECT_EQ(cloud.points[0].x, 1);
  EXPECT_EQ(values<std::uint8_t>(cloud, "i")[0], 7);
  EXPECT_EQ(image(cloud, Format::csv), "A,B,C,D\n7,2,1,3\n");
  ReadOptions skipping{.skip_lines = 2};
  const std::string text = "1 2 3\n4 5 6\n7 8 9\n";
  const Cloud skipped = read_with(text, skipping, "a.xyz");
  ASSERT_EQ(skipped.points.size(), 1U);
  EXPECT_EQ(skipped.points[0].x, 7);
  EXPECT_EQ(image(skipped, Format::xyz), text);
  EXPECT_EQ(read_with("x,y,z\n1,2,3\n", {.format = Format::csv}, "a.data").points.size(), 1U);
  EXPECT_EQ(thrown_by([&] { read_with("v 1 2 3\n", skipping, "a.obj"); }).kind, ErrorKind::usage);
  named.columns = {"x", "y", "z", "i", "j"};
  expect_error(ErrorKind::file, "--columns names 5 columns", [&] { read_with("1,2,3\n", named); });
}

TEST(FilesCases, IntegersKeepTheirDigitsInEveryEncoding) {
  const std::string text = ply(kXyz + "property int64 a\nproperty uint64 b\n",
                               "1 2 3 1152921504606846977 18446744073709551615\n4 5 6 -7 0\n");
  for (const Encoding encoding : {Encoding::binary, Encoding::binary_big_endian}) {
    const Cloud other = parse(image(parse(text), Format::ply, encoding));
    EXPECT_EQ(image(other, Format::ply, Encoding::ascii), text);
  }
  const Cloud csv = parse("x,y,z,t\n1,2,3,1234567890123456789\n4,5,6,7\n", "a.csv");
  for (const Encoding encoding : {Encoding::ascii, Encoding::binary, Encoding::binary_compressed}) {
    const Cloud pcd = parse(image(csv, Format::pcd, encoding), "a.pcd");
    EXPECT_NE(image(pcd, Format::csv).find("1234567890123456789\n"), std::string::npos);
  }
}

TEST(FilesCases, DigitsThatAreLostForAMissingNumberAreTold) {
  const Cloud cloud = parse("x,y,z,t\n1,2,3,1234567890123456789\n4,5,6,\n", "a.csv");
  for (const Format format : {Format::ply, Format::pcd, Format::npy}) {
    const std::vector<std::string> notes = losses(cloud, format);
    ASSERT_EQ(notes.size(), 1U);
    EXPECT_NE(notes[0].find("the last digits of the column 't'"), std::string::npos) << notes[0];
  }
  EXPECT_TRUE(losses(parse("x,y,z,t\n1,2,3,1234567890.5\n4,5,6,\n", "a.csv"), Format::pcd).empty());
}

TEST(FilesCases, ColoursKeepTheirMeaning) {
  const auto reds = [](const std::string& values) {
    const Cloud cloud = parse("x,y,z,red,green,blue\n1,2,3," + values + "\n", "a.csv");
    const std::string text = image(cloud, Format::ply, Encoding::ascii);
    EXPECT_NE(text.find("property uchar red"), std::string::npos) << values;
    return text.substr(text.find("end_header\n") + 17);
  };
  EXPECT_EQ(reds("0.2,1.0,0.0"), "51 255 0\n");
  EXPECT_EQ(reds("51.0,255.0,0.5"), "51 255 0\n");
  EXPECT_EQ(reds("13107,65535,0"), "51 255 0\n");
  EXPECT_EQ(reds("13107.0,65535.0,0"), "51 255 0\n");
  EXPECT_EQ(reds("51,255,0"), "51 255 0\n");
}

TEST(FilesCases, ColoursOfSixteenBitsBecomeBytesInPly) {
  for (const unsigned format : {2U, 3U, 7U, 8U}) {
    const Cloud las = parse(make_las({.minor = 4, .format = format, .count = 20}), "a.las"),
                ply = parse(image(las, Format::ply));
    const auto wide = values<std::uint16_t>(las, "green");
    const auto bytes = values<std::uint8_t>(ply, "green");
    for (std::size_t i = 0; i < wide.size(); ++i) EXPECT_EQ(bytes[i], (wide[i] + 128) / 257) << format;
  }
}

}  // namespace pointfair::test
