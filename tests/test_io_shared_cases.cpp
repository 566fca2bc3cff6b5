// SPDX-License-Identifier: Apache-2.0
// Files of others that once went wrong, each as one cloud with a known number of points.
#include <cstdlib>

#include "io/source.hpp"
#include "io_files.h"

namespace pointfair::test {

// The shared cases, where they are: POINTFAIR_DATA names the folder above them.
TEST(FilesCases, TheSharedCasesAreReadRight) {
  const char* const data = std::getenv("POINTFAIR_DATA");
  if (!data) GTEST_SKIP() << "POINTFAIR_DATA is not set";
  struct Shared {
    const char* name;
    std::size_t points;
    const char* attributes;  // all, each behind a blank
  };
  const Shared all[] = {{"bom.obj", 600, ""},
                        {"bom.ply", 600, ""},
                        {"crlf_bom.off", 600, ""},
                        {"mac_cr300.xyz", 300, ""},
                        {"mac_cr300.obj", 300, ""},
                        {"mac_cr.ply", 600, ""},
                        {"color255.obj", 600, " red green blue"},
                        {"float_colors_255.ply", 500, " red green blue"},
                        {"cloudcompare_rf_gf_bf.txt", 500, " Rf Gf Bf Nx Ny Nz"},
                        {"some_colors.obj", 600, " red green blue"},
                        {"off_rgb_plain.off", 600, " red green blue"},
                        {"viewlist.ply", 600, " type"},
                        {"tristrips.ply", 600, ""},
                        {"vn.obj", 600, " nx ny nz"},
                        {"text_col.csv", 600, ""},
                        {"normals_ext.xyzn", 500, " nx ny nz"},
                        {"colors_ext.xyzrgb", 500, " red green blue"},
                        {"bigints.csv", 600, " gps_ns"},
                        {"uint64_times.pcd", 500, " t"},
                        {"int64.ply", 600, " id"},
                        {"bool.ply", 600, " keep"},
                        {"dup_names.csv", 600, " i i_2"},
                        {"negzero.txt", 400, " c"},
                        {"modelnet.off", 600, ""},
                        {"wrapped.off", 600, ""},
                        {"two_per_line.off", 600, ""},
                        {"nokey.off", 600, ""},
                        {"lower.off", 600, ""},
                        {"upper_xyz.ply", 600, ""},
                        {"upperfields.pcd", 600, ""},
                        {"cc_count.asc", 600, " Rf Gf Bf Intensity"},
                        {"cc_count.txt", 600, ""},
                        {"two_scans.pts", 600, " intensity red green blue"},
                        {"title_line.xyz", 600, ""},
                        {"units_row.csv", 600, ""},
                        {"percent_comment.txt", 600, ""},
                        {"quoted_numbers.csv", 600, ""},
                        {"empty_xyz_fields.csv", 600, " i"},
                        {"nan_msvc_old.xyz", 600, ""},
                        {"nul_tail.xyz", 600, ""},
                        {"easting.csv", 600, ""},
                        {"paraview.csv", 600, " Intensity"},
                        {"units_in_names.csv", 600, " I"},
                        {"decimal_comma_semicolon.csv", 600, " i"},
                        {"decimal_comma_space.xyz", 600, ""},
                        {"contin.obj", 600, ""},
                        {"wrapped_rows.ply", 600, " red"},
                        {"label_extra_line.pcd", 600, ""}};
  for (const Shared& shared : all) {
    SCOPED_TRACE(shared.name);
    const std::filesystem::path path = std::filesystem::path(data) / "cases" / shared.name;
    const Cloud cloud = read(path);
    EXPECT_EQ(cloud.points.size(), shared.points);
    std::string names;
    for (const AttributeInfo& info : attributes(cloud)) names += " " + info.name;
    EXPECT_EQ(names, shared.attributes);
    EXPECT_EQ(image(cloud, cloud.source->format(), cloud.source->encoding()), file_bytes(path));
    // most are one cloud of 600 points, of which this is the third
    if (shared.points == 600) {
      EXPECT_NEAR(cloud.points[2].x, 8.012745, 1e-6);
      EXPECT_NEAR(cloud.points[2].y, 6.608962, 1e-6);
      EXPECT_NEAR(cloud.points[2].z, 0.260012, 1e-6);
    }
  }
  const std::string utf16 = (std::filesystem::path(data) / "cases" / "utf16.csv").string();
  EXPECT_NE(thrown_by([&] { read(utf16); }).message.find("UTF-16"), std::string::npos);
}

// A scanner at (5, 6, 7) that is not turned; and colours of 16 bits, which are 257 times those of 8.
TEST(FilesCases, TheSharedScanAndColoursAreReadRight) {
  const char* const data = std::getenv("POINTFAIR_DATA");
  if (!data) GTEST_SKIP() << "POINTFAIR_DATA is not set";
  const std::filesystem::path folder = std::filesystem::path(data) / "cases";
  const Cloud scan = read(folder / "scan.ptx");
  ASSERT_EQ(scan.points.size(), 600U);
  EXPECT_NEAR(scan.origin[0] + scan.points[2].x, 13.012745, 1e-6);
  EXPECT_NEAR(scan.origin[1] + scan.points[2].y, 12.608962, 1e-6);
  EXPECT_NEAR(scan.origin[2] + scan.points[2].z, 7.260012, 1e-6);
  EXPECT_EQ(image(scan, Format::ptx), file_bytes(folder / "scan.ptx"));
  const Cloud las = read(folder / "colors16.las"), ply = parse(image(las, Format::ply));
  for (const char* channel : {"red", "green", "blue"}) {
    const auto wide = values<std::uint16_t>(las, channel);
    const auto bytes = values<std::uint8_t>(ply, channel);
    ASSERT_EQ(bytes.size(), wide.size());
    EXPECT_GT(*std::max_element(wide.begin(), wide.end()), 255);
    for (std::size_t i = 0; i < wide.size(); ++i) EXPECT_EQ(bytes[i], (wide[i] + 128) / 257);
  }
}

}  // namespace pointfair::test
