// SPDX-License-Identifier: Apache-2.0
// Two variants or more of each file that once went wrong.
#include <cmath>
#include <map>

#include "io/source.hpp"
#include "io_variants.h"
#include "las_files.h"

namespace pointfair::test {
namespace {

std::string as_txt(const std::string& csv) {
  const std::string text = replaced(csv, ",", " ");
  return text.starts_with("x y z\n") ? text.substr(6) : text;
}

}  // namespace

TEST(FilesVariants, EachIsReadRightAndCopiedByteForByte) {
  for (const auto& [of, given, word, told_by] : variants::all_variants()) {
    SCOPED_TRACE(of + " as " + given.name + ": " + given.bytes.substr(0, 200));
    Cloud cloud;
    try {
      cloud = parse(given.bytes, given.name);
    } catch (const Error& error) {
      ADD_FAILURE() << error.what();
      continue;
    }
    const bool is_csv = given.name.ends_with(".csv");
    EXPECT_EQ(image(cloud, is_csv ? Format::txt : Format::csv), is_csv ? as_txt(given.csv) : given.csv);
    EXPECT_EQ(image(cloud, cloud.source->format(), cloud.source->encoding()), given.bytes);
    cloud.points.back().x += 0.5F;
    const Cloud again = parse(image(cloud, cloud.source->format(), cloud.source->encoding()), given.name);
    ASSERT_EQ(again.points.size(), cloud.points.size());
    if (std::isfinite(cloud.points.back().x)) {
      EXPECT_EQ(again.origin[0] + again.points.back().x, cloud.origin[0] + cloud.points.back().x);
    }
  }
}

TEST(FilesVariants, WhatIsLostIsTold) {
  for (const auto& [of, given, word, told_by] : variants::all_variants()) {
    if (word.empty()) continue;
    std::string notes;
    for (const std::string& note : losses(parse(given.bytes, given.name), told_by)) notes += note + "\n";
    EXPECT_NE(notes.find(word), std::string::npos) << of << ": " << notes;
  }
}

TEST(FilesVariants, EachKindOfFileHasTwo) {
  std::map<std::string, int> count;
  for (const variants::Variant& variant : variants::all_variants()) ++count[variant.of];
  for (const auto& [name, variants] : count) EXPECT_GE(variants, 2) << name;
  EXPECT_EQ(count.size(), 49U);
}

// Those whose right result is a refusal, or that are made by code.
TEST(FilesVariants, Utf16IsNamed) {
  for (const std::string& front : {std::string("\xFF\xFE", 2), std::string("\xFE\xFF", 2)})
    for (const char* name : {"a.csv", "a.ply", "a.obj", "a.asc"}) {
      expect_refused(front + std::string("v\0 \0", 4), name, "is text in UTF-16; convert it to UTF-8");
    }
}

TEST(FilesVariants, ColoursOfSixteenBitsBecomeBytesInPly) {
  for (const unsigned format : {2U, 3U, 7U, 8U}) {
    const Cloud las = parse(make_las({.minor = 4, .format = format, .count = 20}), "a.las"),
                ply = parse(image(las, Format::ply));
    const auto wide = values<std::uint16_t>(las, "green");
    const auto bytes = values<std::uint8_t>(ply, "green");
    for (std::size_t i = 0; i < wide.size(); ++i) EXPECT_EQ(bytes[i], (wide[i] + 128) / 257) << format;
  }
}

}  // namespace pointfair::test
