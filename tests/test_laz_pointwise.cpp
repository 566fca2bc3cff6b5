// SPDX-License-Identifier: Apache-2.0
// LAZ without chunks, as LASzip wrote before 2.0, made by LASzip; and LAS 1.5.
#include "io_files.h"
#include "laz_oracle.h"

namespace pointfair::test {
namespace {

std::string old_las(unsigned format, std::uint32_t count = 300) {
  return make_las({.minor = format < 4 ? 2U : 3U, .format = format, .count = count, .plain_extra = format % 2 * 2});
}

std::string pointwise(const std::string& las, unsigned version = 0) {
  LazSpec spec;
  spec.pointwise = true;
  spec.version = version;
  return make_laz(las, spec);
}

std::string records(const std::string& las) {
  return las.substr(las_points_begin(las), static_cast<std::size_t>(las_count(las)) * las_record_length(las));
}

// The same file with the 18 bytes that LAS 1.5 has more in its header.
std::string as_1_5(std::string las) {
  las.insert(375, 18, '\7');
  las[25] = 5;
  las_put(las, 94, static_cast<std::uint16_t>(las_get<std::uint16_t>(las, 94) + 18));
  las_put(las, 96, las_get<std::uint32_t>(las, 96) + 18);
  if (las_get<std::uint32_t>(las, 243) != 0) las_put(las, 235, las_get<std::uint64_t>(las, 235) + 18);
  return las;
}

}  // namespace

TEST(LazPointwise, IsReadAndComesBackAsItIs) {
  for (const unsigned format : {0U, 1U, 2U, 3U, 4U, 5U}) {
    for (const unsigned version : {0U, 1U}) {
      SCOPED_TRACE(std::to_string(format) + " version " + std::to_string(version));
      const std::string las = old_las(format), laz = pointwise(las, version);
      const Cloud cloud = parse(laz, "a.laz");
      const Cloud plain = parse(las, "a.las");
      ASSERT_EQ(cloud.points.size(), plain.points.size());
      EXPECT_EQ(std::memcmp(cloud.points.data(), plain.points.data(), plain.points.size() * sizeof(Point)), 0);
      EXPECT_EQ(image(cloud, Format::laz), laz);
      EXPECT_EQ(records(image(cloud, Format::las)), records(las));
    }
  }
}

TEST(LazPointwise, MovedPointsAreWrittenInChunks) {
  const std::string las = old_las(3, 1000);
  Cloud cloud = parse(pointwise(las), "a.laz"), plain = parse(las, "a.las");
  for (Cloud* const moved : {&cloud, &plain}) moved->points[7].z += 5;
  const std::string laz = image(cloud, Format::laz);
  EXPECT_EQ(laz_records(laz), records(image(plain, Format::las)));
}

TEST(LazPointwise, PrefixesAreReadOrRefusedInOneLine) {
  const std::string laz = pointwise(old_las(1, 40));
  std::size_t refused = 0;
  for (std::size_t size = 1; size < laz.size(); ++size) {
    try {
      EXPECT_EQ(parse(laz.substr(0, size), "cut.laz", Format::laz).points.size(), 40U);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::file);
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
      ++refused;
    }
  }
  EXPECT_GT(refused, laz.size() - 8);
}

TEST(Las15, IsReadAndWrittenBack) {
  for (const unsigned format : {6U, 7U, 8U, 10U}) {
    const std::string las = as_1_5(make_las({.minor = 4, .format = format}));
    Cloud cloud = parse(las, "a.las");
    EXPECT_EQ(cloud.points.size(), 100U);
    EXPECT_EQ(image(cloud, Format::las), las);
    const std::string laz = image(cloud, Format::laz);
    EXPECT_EQ(laz.substr(375, 18), std::string(18, '\7'));
    EXPECT_EQ(laz_records(laz), records(las));
    EXPECT_EQ(image(parse(laz, "a.laz"), Format::laz), laz);
  }
  std::string small = make_las({.minor = 4, .format = 6});
  small[25] = 5;
  EXPECT_EQ(thrown_by([&] { parse(small, "a.las"); }).kind, ErrorKind::file);
}

}  // namespace pointfair::test
