// SPDX-License-Identifier: Apache-2.0
// COPC as written: its records and pages are read here by the specification, its chunks by LASzip.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "io_files.h"
#include "laz_oracle.h"

namespace pointfair::test {
namespace {

struct Node {
  std::int32_t level = 0, at[3] = {}, size = 0, points = 0;
  std::uint64_t offset = 0;
};

struct Copc {
  double center[3], half_side, spacing, least_time, most_time;
  std::vector<Node> nodes;           // in the order of their chunks
  std::vector<std::string> records;  // of all points, in the order of the file
  double scale[3], offset[3];
  double value(const std::string& record, int axis) const {
    return las_get<std::int32_t>(record, 4U * unsigned(axis)) * scale[axis] + offset[axis];
  }
  double low(const Node& node, int axis) const {
    return center[axis] - half_side + 2 * half_side * node.at[axis] / std::exp2(node.level);
  }
};

Copc read_copc(const std::string& file) {
  Copc copc;
  EXPECT_EQ(file.substr(377, 4), "copc");
  EXPECT_EQ(las_get<std::uint16_t>(file, 393), 1);
  EXPECT_EQ(las_get<std::uint16_t>(file, 395), 160);
  std::memcpy(copc.center, file.data() + 429, 24);
  copc.half_side = las_get<double>(file, 429 + 24);
  copc.spacing = las_get<double>(file, 429 + 32);
  const auto begin = las_get<std::uint64_t>(file, 429 + 40), size = las_get<std::uint64_t>(file, 429 + 48);
  copc.least_time = las_get<double>(file, 429 + 56);
  copc.most_time = las_get<double>(file, 429 + 64);
  EXPECT_EQ(las_get<std::uint64_t>(file, 235) + 60, begin);
  EXPECT_EQ(size % 32, 0U);
  for (std::uint64_t at = begin; at < begin + size; at += 32) {
    Node node;
    std::memcpy(&node.level, file.data() + at, 4);
    std::memcpy(node.at, file.data() + at + 4, 12);
    node.offset = las_get<std::uint64_t>(file, at + 16);
    node.size = las_get<std::int32_t>(file, at + 24);
    node.points = las_get<std::int32_t>(file, at + 28);
    copc.nodes.push_back(node);
  }
  std::sort(copc.nodes.begin(), copc.nodes.end(), [](const Node& a, const Node& b) { return a.offset < b.offset; });
  for (int axis = 0; axis < 3; ++axis) {
    copc.scale[axis] = las_get<double>(file, 131 + 8U * unsigned(axis));
    copc.offset[axis] = las_get<double>(file, 155 + 8U * unsigned(axis));
  }
  const std::string all = laz_records(file);
  const std::size_t length = las_record_length(file);
  for (std::size_t at = 0; at < all.size(); at += length) copc.records.push_back(all.substr(at, length));
  return copc;
}

// Ground with trees: enough points for several levels.
std::string survey(unsigned format, std::uint32_t count) {
  std::string las = make_las({.minor = 4, .format = format, .count = count, .plain_extra = 3});
  std::mt19937 random(5);
  const std::size_t begin = las_points_begin(las), length = las_record_length(las);
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto pick = [&](int range) { return static_cast<std::int32_t>(random() % unsigned(range)); };
    const std::int32_t x = pick(200000), y = pick(100000), z = i % 5 == 0 ? pick(20000) : (x + y) / 50;
    las_put(las, begin + i * length, x);
    las_put(las, begin + i * length + 4, y);
    las_put(las, begin + i * length + 8, z);
  }
  return las;
}

std::string as_copc(const std::string& las) { return image(parse(las, "a.las"), Format::copc); }

void expect_octree(const Copc& copc) {
  std::size_t next = 0;
  std::set<std::array<std::int32_t, 4>> keys;
  for (const Node& node : copc.nodes) keys.insert({node.level, node.at[0], node.at[1], node.at[2]});
  EXPECT_EQ(keys.size(), copc.nodes.size());
  const double slack = 1e-6 * copc.scale[0];
  for (const Node& node : copc.nodes) {
    ASSERT_GT(node.points, 0);
    if (node.level > 0) {
      EXPECT_TRUE(keys.count({node.level - 1, node.at[0] / 2, node.at[1] / 2, node.at[2] / 2})) << "an orphan";
    }
    bool has_children = false;
    for (int eighth = 0; eighth < 8; ++eighth)
      has_children = has_children || keys.count({node.level + 1, 2 * node.at[0] + (eighth & 1),
                                                 2 * node.at[1] + (eighth >> 1 & 1), 2 * node.at[2] + (eighth >> 2)});
    const double side = 2 * copc.half_side / std::exp2(node.level), spacing = copc.spacing / std::exp2(node.level);
    std::set<std::array<std::int64_t, 3>> cells;
    for (std::int32_t i = 0; i < node.points; ++i, ++next) {
      std::array<std::int64_t, 3> cell{};
      for (int axis = 0; axis < 3; ++axis) {
        const double from_low = copc.value(copc.records[next], axis) - copc.low(node, axis);
        ASSERT_GE(from_low, -slack);
        ASSERT_LE(from_low, side + slack);
        cell[std::size_t(axis)] = static_cast<std::int64_t>(std::floor(from_low / spacing));
      }
      if (!has_children) continue;
      ASSERT_TRUE(cells.insert(cell).second) << "two points of a cell at level " << node.level;
    }
  }
  EXPECT_EQ(next, copc.records.size());
}

}  // namespace

TEST(Copc, EveryPointIsOnceInANodeAroundItAndSpacingHalves) {
  const std::string las = survey(6, 60000), file = as_copc(las);
  const Copc copc = read_copc(file);
  EXPECT_GE(copc.nodes.back().level, 2);
  expect_octree(copc);
  std::multiset<std::string> before, after(copc.records.begin(), copc.records.end());
  const std::size_t begin = las_points_begin(las), length = las_record_length(las);
  for (std::size_t i = 0; i < 60000; ++i) before.insert(las.substr(begin + i * length, length));
  EXPECT_EQ(before, after);
  EXPECT_EQ(parse(file, "a.copc.laz").points.size(), 60000U);
  EXPECT_EQ(parse(file, "a.copc.laz", Format::copc).points.size(), 60000U);
}

TEST(Copc, AQueryFindsWhatBruteForceDoes) {
  const Copc copc = read_copc(as_copc(survey(7, 40000)));
  std::mt19937 random(3);
  for (int trial = 0; trial < 30; ++trial) {
    double low[3], high[3];
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = copc.center[axis] - copc.half_side + 2 * copc.half_side * double(random() % 900) / 1000;
      high[axis] = low[axis] + copc.half_side * double(random() % 1000) / 1500;
    }
    const auto inside = [&](const std::string& record) {
      bool all = true;
      for (int axis = 0; axis < 3; ++axis)
        all = all && copc.value(record, axis) >= low[axis] && copc.value(record, axis) <= high[axis];
      return all;
    };
    std::size_t found = 0, next = 0;
    for (const Node& node : copc.nodes) {
      bool meets = true;
      for (int axis = 0; axis < 3; ++axis) {
        const double side = 2 * copc.half_side / std::exp2(node.level);
        meets = meets && copc.low(node, axis) <= high[axis] && copc.low(node, axis) + side >= low[axis];
      }
      for (std::int32_t i = 0; i < node.points; ++i, ++next) found += meets && inside(copc.records[next]);
    }
    EXPECT_EQ(found, std::size_t(std::count_if(copc.records.begin(), copc.records.end(), inside)));
  }
}

TEST(Copc, OlderPointsKeepEveryAttribute) {
  for (const unsigned format : {0U, 1U, 2U, 3U, 8U}) {
    SCOPED_TRACE(format);
    LasSpec spec{.minor = format == 8 ? 4U : 2U, .format = format, .count = 500, .described = true};
    const Cloud before = parse(make_las(spec), "a.las");
    const std::string file = as_copc(make_las(spec));
    const Copc copc = read_copc(file);
    expect_octree(copc);
    const Cloud after = parse(file, "a.copc.laz");
    ASSERT_EQ(after.points.size(), 500U);
    // in an order of their own: by position and intensity
    const auto sorted = [](const Cloud& cloud, const std::string& name) {
      const std::vector<std::uint16_t> intensity = values<std::uint16_t>(cloud, "intensity");
      const Attribute wanted = attribute(cloud, name);
      const std::size_t size = wanted.data.size() / cloud.points.size();
      std::multiset<std::string> rows;
      for (std::size_t i = 0; i < cloud.points.size(); ++i)
        rows.insert(std::to_string(cloud.points[i].x) + " " + std::to_string(cloud.points[i].z) + " " +
                    std::to_string(intensity[i]) + " " +
                    std::string(reinterpret_cast<const char*>(wanted.data.data()) + i * size, size));
      return rows;
    };
    for (const AttributeInfo& info : attributes(before)) {
      if (info.name == "scan_angle_rank") continue;  // is there in steps of .006 degrees
      SCOPED_TRACE(info.name);
      EXPECT_EQ(sorted(before, info.name), sorted(after, info.name));
    }
  }
}

TEST(Copc, WhatALasFileHasBesidePointsIsKept) {
  const std::string las = make_las({.minor = 4, .format = 6, .count = 300}), file = as_copc(las);
  EXPECT_EQ(las_get<std::uint32_t>(file, 243), 3U);  // the hierarchy, and two of the file's own
  EXPECT_NE(file.find("made by the tests"), std::string::npos);
  EXPECT_EQ(las_get<std::uint64_t>(file, 247), 300U);
  std::uint64_t returns = 0;
  for (std::size_t r = 0; r < 15; ++r) returns += las_get<std::uint64_t>(file, 255 + 8 * r);
  EXPECT_LE(returns, 300U);
  const Copc copc = read_copc(file);
  double least = INFINITY, most = -INFINITY;
  for (const std::string& record : copc.records) {
    least = std::min(least, las_get<double>(record, 22));
    most = std::max(most, las_get<double>(record, 22));
  }
  EXPECT_EQ(copc.least_time, least);
  EXPECT_EQ(copc.most_time, most);
  EXPECT_TRUE(losses(parse(las, "a.las"), Format::copc).empty());  // of few points the order stays
}

TEST(Copc, CloudsOfOtherFormatsAndOnesThatAreSmallOrFlat) {
  Cloud cloud{.points = {{1, 2, 3}}};
  expect_octree(read_copc(image(cloud, Format::copc)));
  EXPECT_TRUE(keeps_order(cloud, Format::copc));
  for (int i = 0; i < 9000; ++i) cloud.points.push_back({float(i % 90), float(i / 90), 3});
  EXPECT_FALSE(keeps_order(cloud, Format::copc));
  EXPECT_EQ(losses(cloud, Format::copc).size(), 1U);               // the order
  cloud.points.insert(cloud.points.end(), 12000, Point{4, 5, 6});  // many at one place
  cloud.added = {make_attribute<std::uint8_t>("mark", ScalarType::uint8, std::vector<std::uint8_t>(21001, 7))};
  const std::string file = image(cloud, Format::copc);
  const Copc copc = read_copc(file);
  EXPECT_EQ(copc.records.size(), 21001U);
  EXPECT_EQ(values<std::uint8_t>(parse(file, "a.laz"), "mark"), std::vector<std::uint8_t>(21001, 7));
  cloud.points[0].x = NAN;
  EXPECT_EQ(thrown_by([&] { image(cloud, Format::copc); }).kind, ErrorKind::usage);
}

TEST(Copc, WavePacketsAreRefusedBeforeARun) {
  LasSpec spec{.minor = 4, .format = 9};
  const Folder folder;
  const Cloud cloud = parse(make_las(spec), "a.las");
  EXPECT_EQ(thrown_by([&] { check_write(folder / "a.copc.laz", cloud); }).kind, ErrorKind::usage);
}

}  // namespace pointfair::test
