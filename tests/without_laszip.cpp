// SPDX-License-Identifier: Apache-2.0
// LAZ files in a build without LASzip: laszip_absent.cpp is linked into this program in place of laszip_codec.cpp.
// LASzip itself makes the files and reads what is written.
#include <gtest/gtest.h>

#include "io_files.h"
#include "laz_oracle.h"
#include "pointfair/file_info.hpp"

namespace pointfair::test {
namespace {

constexpr const char* kAdvice = "build again with -DPOINTFAIR_LAS=ON";

std::string las_of(unsigned format) {
  LasSpec spec;
  spec.format = format;
  spec.minor = format >= 6 ? 4 : 3;
  spec.plain_extra = 2;
  return make_las(spec);
}

std::string records_of(const std::string& las) {
  return las.substr(las_points_begin(las), static_cast<std::size_t>(las_count(las)) * las_record_length(las));
}

template <class Work>
std::string error_of(const Work& work) {
  try {
    work();
  } catch (const Error& error) {
    EXPECT_EQ(error.kind(), ErrorKind::file);
    return error.what();
  }
  return "none";
}

TEST(WithoutLaszip, StrengthZeroIsTheSameFile) {
  for (const unsigned format : {0, 1, 2, 3, 6, 7, 8, 9, 10}) {
    const std::string laz = make_laz(las_of(format), {});
    EXPECT_TRUE(image(parse(laz, "a.laz"), Format::laz) == laz) << format;
  }
}

TEST(WithoutLaszip, AfterAMoveLaszipReadsTheRecordsOfTheUncompressedFile) {
  for (const unsigned format : {0, 1, 2, 3, 6, 7, 8, 9, 10}) {
    const std::string las = las_of(format);
    Cloud plain = parse(las, "a.las"), packed = parse(make_laz(las, {}), "a.laz");
    ASSERT_EQ(plain.points.size(), packed.points.size()) << format;
    for (std::size_t i = 0; i < plain.points.size(); i += 2) {
      plain.points[i].z += 0.5F;
      packed.points[i].z += 0.5F;
    }
    EXPECT_TRUE(laz_records(image(packed, Format::laz)) == records_of(image(plain, Format::las))) << format;
  }
}

TEST(WithoutLaszip, AttributesOfFormats0To3AreThoseOfTheUncompressedFile) {
  for (const unsigned format : {0, 1, 2, 3}) {
    const std::string las = las_of(format);
    const Cloud plain = parse(las, "a.las"), packed = parse(make_laz(las, {}), "a.laz");
    EXPECT_TRUE(file_info(packed).has_attributes);
    for (const AttributeInfo& info : attributes(plain))
      EXPECT_EQ(attribute(plain, info.name).data, attribute(packed, info.name).data) << info.name;
  }
}

TEST(WithoutLaszip, AttributesOfFormats6To10AreRefusedInALineThatSaysWhatToInstall) {
  for (const unsigned format : {6, 7, 8, 9, 10}) {
    const Cloud cloud = parse(make_laz(las_of(format), {}), "a.laz");
    EXPECT_FALSE(file_info(cloud).has_attributes);
    const std::string error = error_of([&] { attribute(cloud, "classification"); });
    EXPECT_TRUE(error.starts_with("a.laz: attributes of such points need LASzip")) << error;
    EXPECT_NE(error.find(kAdvice), std::string::npos) << error;
    EXPECT_NE(error_of([&] { image(cloud, Format::ply); }).find(kAdvice), std::string::npos);
  }
}

TEST(WithoutLaszip, OtherPointsAreRefusedInALineThatSaysWhatToInstall) {
  for (const unsigned format : {4, 5}) {
    const std::string error = error_of([&] { parse(make_laz(las_of(format), {}), "a.laz"); });
    EXPECT_TRUE(error.starts_with("a.laz: such points need LASzip")) << error;
    EXPECT_NE(error.find(kAdvice), std::string::npos) << error;
  }
  const std::string old = error_of([&] { parse(make_laz(las_of(1), {.version = 1}), "a.laz"); });
  EXPECT_NE(old.find(kAdvice), std::string::npos) << old;
}

TEST(WithoutLaszip, NewFilesAreRefusedInALineThatSaysWhatToInstall) {
  Cloud made;
  made.points = {{0, 0, 0}, {1, 2, 3}};
  EXPECT_NE(error_of([&] { image(made, Format::laz); }).find(kAdvice), std::string::npos);
  const Cloud plain = parse(las_of(6), "a.las");
  EXPECT_NE(error_of([&] { image(plain, Format::laz); }).find(kAdvice), std::string::npos);
  const std::string las = las_of(3);
  EXPECT_TRUE(laz_records(image(parse(las, "a.las"), Format::laz)) == records_of(las));
}

}  // namespace
}  // namespace pointfair::test
