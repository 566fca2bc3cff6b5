// SPDX-License-Identifier: Apache-2.0
// Moved points change their coordinates in the file, and nothing else; origins; added attributes.
#include <bit>
#include <cmath>
#include <sstream>

#include "io_files.h"
#include "shapes.h"

namespace pointfair::test {
namespace {

std::vector<std::string> words(const std::string& text) {
  std::istringstream stream(text);
  return {std::istream_iterator<std::string>(stream), {}};
}

const Sample& sample(const std::string& name) {
  static const std::vector<Sample> all = samples();
  return *std::find_if(all.begin(), all.end(), [&](const Sample& s) { return s.name == name; });
}

}  // namespace

TEST(FilesMoves, OnlyTheBytesOfTheMovedCoordinateChange) {
  for (const std::string name : {"records.ply", "records_big.ply", "little.ply", "big.ply", "binary.pcd"}) {
    SCOPED_TRACE(name);
    const std::string before = sample(name).bytes;
    Cloud cloud = parse(before, name);
    const float old = cloud.points[1].y;
    cloud.points[1].y = old + 0.25F;
    const std::string after = image(cloud, *format_of(name));
    ASSERT_EQ(after.size(), before.size());
    const auto differs = std::mismatch(before.begin(), before.end(), after.begin());
    const auto behind = std::mismatch(before.rbegin(), before.rend(), after.rbegin());
    EXPECT_LE(behind.first.base() - differs.first, 4) << "more than one float changed";
    EXPECT_EQ(parse(after, name).points[1].y, old + 0.25F);
  }
}

TEST(FilesMoves, OnlyTheWordsOfTheMovedCoordinateChange) {
  for (const std::string name : {"ascii.ply", "ascii.pcd", "plain.xyz", "named.csv", "marked.txt", "scan.pts",
                                 "mesh.off", "colors.off", "mesh.obj", "colors.obj"}) {
    SCOPED_TRACE(name);
    const std::string before = sample(name).bytes;
    Cloud cloud = parse(before, name);
    const std::size_t last = cloud.points.size() - 1;
    const Point old = cloud.points[last];
    cloud.points[last].x += 0.25F;
    cloud.points[last].z -= 0.5F;
    const std::string after = image(cloud, *format_of(name));
    const auto split_before = words(before), split_after = words(after);
    ASSERT_EQ(split_before.size(), split_after.size());
    const bool joined = name == "named.csv" || name == "marked.txt";  // no blanks between columns
    std::ptrdiff_t changed = 0;
    for (std::size_t w = 0; w < split_before.size(); ++w) changed += split_before[w] != split_after[w];
    EXPECT_EQ(changed, joined ? 1 : 2);
    EXPECT_EQ(std::count(before.begin(), before.end(), '\n'), std::count(after.begin(), after.end(), '\n'));
    const Cloud again = parse(after, name);
    EXPECT_FLOAT_EQ(again.points[last].x, old.x + 0.25F);
    EXPECT_EQ(again.points[last].y, old.y);
    EXPECT_FLOAT_EQ(again.points[last].z, old.z - 0.5F);
  }
}

TEST(FilesMoves, ACompressedFileIsPackedAgain) {
  Cloud cloud = parse(sample("compressed.pcd").bytes, "a.pcd");
  cloud.points[3].x = 40;
  const std::string after = image(cloud, Format::pcd);
  const Cloud again = parse(after, "a.pcd");
  EXPECT_EQ(again.points[3].x, 40);
  EXPECT_EQ(again.points[3].y, 4);
  EXPECT_TRUE(std::isnan(again.points[2].x));
  EXPECT_EQ(attribute(again, "hist").data, attribute(cloud, "hist").data);
  EXPECT_NE(after.find("VIEWPOINT 1 2 3 1 0 0 0\nPOINTS 4\nDATA binary_compressed\n"), std::string::npos);
}

TEST(FilesMoves, FloatsNearZeroAreTheFilesOwnBits) {
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
      "property float z\nend_header\n";
  const std::vector<float> numbers = {
      0.1F, -0.0F, 1e-42F, 3.4e38F, 1e-9F, 12345.678F, std::bit_cast<float>(0x7fb12345U), INFINITY, -1, 2, 3, 4e-3F};
  for (const float f : numbers) bytes += packed<float>({f});
  const Cloud cloud = parse(bytes);
  EXPECT_EQ(cloud.origin, (std::array<double, 3>{0, 0, 0}));
  EXPECT_EQ(std::memcmp(cloud.points.data(), numbers.data(), numbers.size() * sizeof(float)), 0);
  EXPECT_EQ(image(cloud, Format::ply), bytes);
}

TEST(FilesMoves, MillimetresAtUtmCoordinatesAreExact) {
  std::string text;
  std::vector<std::array<double, 3>> truth;
  for (int i = 0; i < 500; ++i) {
    truth.push_back({691234.567 + i * 0.123, 5334567.891 - i * 0.077, 512.003 + (i % 10) * 0.001});
    char line[100];
    std::snprintf(line, sizeof line, "%.3f %.3f %.3f\n", truth.back()[0], truth.back()[1], truth.back()[2]);
    text += line;
  }
  Cloud cloud = parse(text, "utm.xyz");
  ASSERT_NE(cloud.origin[0], 0);
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const Point& p = cloud.points[i];
    EXPECT_NEAR(cloud.origin[0] + p.x, truth[i][0], 1e-5);
    EXPECT_NEAR(cloud.origin[1] + p.y, truth[i][1], 1e-5);
    EXPECT_NEAR(cloud.origin[2] + p.z, truth[i][2], 4e-5);
  }
  EXPECT_EQ(image(cloud, Format::xyz), text);
  for (Point& p : cloud.points) p.y += 0.25F;
  const Cloud again = parse(image(cloud, Format::xyz), "utm.xyz");
  for (std::size_t i = 0; i < truth.size(); ++i) {
    EXPECT_NEAR(again.origin[1] + again.points[i].y, truth[i][1] + 0.25, 1e-5);
    EXPECT_EQ(again.points[i].x, cloud.points[i].x);
  }
  // A PLY file of it holds doubles, to the last digit.
  const Cloud ply = parse(image(cloud, Format::ply));
  EXPECT_EQ(image(ply, Format::xyz).substr(0, 10), "691234.567");
}

// Coordinates that are just large enough for an origin: which rows come first must not decide.
TEST(FilesMoves, TheOriginDoesNotDependOnTheOrderOfTheRows) {
  std::vector<std::string> rows;
  for (int i = 0; i < 20000; ++i) {
    const double u = i / 20000.0;
    char line[100];
    std::snprintf(line, sizeof line, "%.6f 0.5 1\n", 2.65 + u);
    rows.emplace_back(line);
  }
  std::optional<Cloud> first;
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    const auto order = shapes::shuffle_order(rows.size(), seed);
    std::string text;
    for (const std::uint32_t i : order) text += rows[i];
    const Cloud cloud = parse(text, "a.xyz");
    if (!first) first = cloud;
    ASSERT_EQ(cloud.origin, first->origin) << seed;
    if (seed > 0) {
      const auto before = shapes::shuffle_order(rows.size(), 0);
      std::vector<Point> by_row(rows.size());
      for (std::size_t i = 0; i < before.size(); ++i) by_row[before[i]] = first->points[i];
      for (std::size_t i = 0; i < order.size(); ++i)
        ASSERT_EQ(std::memcmp(&cloud.points[i], &by_row[order[i]], sizeof(Point)), 0) << i;
    }
  }
}

TEST(FilesMoves, AStrayPointDoesNotHideLargeCoordinates) {
  std::string text = "0 0 0\n";
  for (int i = 0; i < 200; ++i) text += "500000." + std::to_string(100 + i) + " 4000000.5 20\n";
  const Cloud cloud = parse(text, "a.xyz");
  EXPECT_NEAR(cloud.origin[0], 500000, 1);
  EXPECT_NEAR(cloud.origin[0] + cloud.points[1].x, 500000.1, 1e-6);
  EXPECT_EQ(image(cloud, Format::xyz), text);
}

TEST(FilesMoves, LargeFloatsAreSplitWithoutLoss) {
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex 1000\nproperty float x\nproperty float y\n"
      "property float z\nend_header\n";
  std::vector<float> xs;
  for (int i = 0; i < 1000; ++i) {
    xs.push_back(494000.0F + static_cast<float>(i) * 0.53125F);
    bytes += packed<float>({xs.back(), 5420000.0F + static_cast<float>(i % 31) * 0.5F, static_cast<float>(i) * 0.1F});
  }
  const Cloud cloud = parse(bytes);
  ASSERT_NE(cloud.origin[0], 0);
  EXPECT_EQ(cloud.origin[2], 0);
  for (std::size_t i = 0; i < xs.size(); ++i) EXPECT_EQ(cloud.origin[0] + cloud.points[i].x, xs[i]);
  EXPECT_EQ(image(cloud, Format::ply), bytes);
}

TEST(FilesMoves, ADisplacementIsAddedToTheFilesOwnValue) {
  const std::string header =
      "ply\nformat binary_little_endian 1.0\nelement vertex 2\nproperty double x\n"
      "property double y\nproperty double z\nend_header\n";
  const double fine = 0.1234567890123456;  // a float keeps 8 digits of it
  Cloud cloud = parse(header + packed<double>({fine, 1, 2, 3, 4, 5}));
  cloud.points[0].x += 0.5F;
  const float moved = cloud.points[0].x;
  const double expected = fine + (static_cast<double>(moved) - static_cast<double>(static_cast<float>(fine)));
  EXPECT_EQ(image(cloud, Format::ply), header + packed<double>({expected, 1, 2, 3, 4, 5}));
}

TEST(FilesMoves, AMovedWordKeepsItsDecimals) {
  Cloud cloud = parse("1.000000000 2.5 3\n4 5 6\n", "a.xyz");
  cloud.points[0] = {1.5F, 2.75F, 3.125F};
  EXPECT_EQ(image(cloud, Format::xyz), "1.500000000 2.75 3.125\n4 5 6\n");
}

TEST(FilesMoves, IntegersAreRounded) {
  const std::string header =
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty int x\nproperty short y\n"
      "property uchar z\nend_header\n";
  Cloud cloud = parse(header + "1 2 3\n4 5 250\n");
  cloud.points[0] = {1.75F, 2.25F, -7};
  cloud.points[1].z = 900;
  EXPECT_EQ(image(cloud, Format::ply), header + "2 2 -7\n4 5 900\n");
  const std::string binary = image(cloud, Format::ply, Encoding::binary);
  EXPECT_TRUE(binary.ends_with(packed<int>({2}) + packed<short>({2}) + std::string(1, '\0') + packed<int>({4}) +
                               packed<short>({5}) + "\xff"));
}

TEST(FilesMoves, AnotherOriginMovesEveryPoint) {
  Cloud cloud = parse("1 2 3\n4 5 6\n", "a.xyz");
  cloud.origin = {100, 0, 0};
  EXPECT_EQ(image(cloud, Format::xyz), "101 2 3\n104 5 6\n");
}

TEST(FilesMoves, AddedAttributesAreAppended) {
  for (const Sample& s : samples()) {
    const Format format = *format_of(s.name);
    if (format == Format::off || format == Format::obj) continue;  // have no place for them
    SCOPED_TRACE(s.name);
    Cloud cloud = parse(s.bytes, s.name);
    const auto before = attributes(cloud);
    std::vector<float> heights;
    std::vector<std::uint16_t> pairs;
    for (std::size_t i = 0; i < s.points; ++i) {
      heights.push_back(0.1F * static_cast<float>(i));
      pairs.push_back(static_cast<std::uint16_t>(i));
      pairs.push_back(65535);
    }
    cloud.added = {make_attribute("height", ScalarType::float32, heights),
                   make_attribute("pair", ScalarType::uint16, pairs, 2)};
    const Cloud again = parse(image(cloud, format), s.name, format);
    ASSERT_EQ(again.points.size(), s.points);
    for (const AttributeInfo& info : before) {
      if (format == Format::pts) continue;  // its names depend on the number of columns
      EXPECT_EQ(attribute(again, info.name).data, attribute(cloud, info.name).data) << info.name;
    }
    const auto infos = attributes(again);
    const bool pcd = format == Format::pcd, named = format != Format::xyz && format != Format::pts;
    const bool found = std::any_of(infos.begin(), infos.end(), [](auto& info) { return info.name == "height"; });
    EXPECT_EQ(found, named);
    if (format != Format::ply && !pcd) continue;
    EXPECT_EQ(values<float>(again, "height"), heights);
    EXPECT_EQ(values<std::uint16_t>(again, pcd ? "pair" : "pair_1")[1], 65535);
  }
}

TEST(FilesMoves, ACloudThatDoesNotFitItsFileIsRefused) {
  Cloud cloud = parse("1 2 3\n4 5 6\n", "a.xyz");
  cloud.points.pop_back();
  EXPECT_EQ(thrown_by([&] { image(cloud, Format::xyz); }).kind, ErrorKind::usage);
  EXPECT_EQ(thrown_by([&] { image(cloud, Format::ply); }).kind, ErrorKind::usage);
  cloud.points.clear();
  cloud.source = nullptr;
  EXPECT_EQ(thrown_by([&] { image(cloud, Format::ply); }).kind, ErrorKind::usage);
  cloud.points = {{1, 2, 3}};
  cloud.added = {make_attribute<float>("a", ScalarType::float32, {1, 2})};
  EXPECT_EQ(thrown_by([&] { image(cloud, Format::ply); }).kind, ErrorKind::usage);
  cloud.added = {make_attribute<float>("a", ScalarType::float32, {1}),
                 make_attribute<int>("a", ScalarType::int32, {1})};
  EXPECT_EQ(thrown_by([&] { image(cloud, Format::ply); }).kind, ErrorKind::usage);
  cloud.added = {};
  EXPECT_EQ(thrown_by([&] { image(cloud, Format::xyz, Encoding::binary); }).kind, ErrorKind::usage);
}

}  // namespace pointfair::test
