// SPDX-License-Identifier: Apache-2.0
// E57 files: coordinates are changed where they stand, bit for bit, and nothing else is.
#include <numbers>
#include <random>

#include "e57_files.h"
#include "io_files.h"

namespace pointfair::test {
namespace {

constexpr std::size_t kPoints = 700;

std::vector<double> numbers(double begin, double step, std::size_t count = kPoints) {
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = begin + step * static_cast<double>((i * 7919) % 1000);
  return values;
}

// In each of them coordinates are stored in another way.
E57Scan floats(const std::string& type) {
  E57Scan scan;
  for (const char* name : {"cartesianX", "cartesianY", "cartesianZ"})
    scan.fields.push_back({name, type, numbers(1, 0.25), 0, 0, 1, 0, ""});
  scan.fields.push_back({"intensity", "integer", numbers(-3, 1), -3, 1020, 1, 0, ""});
  scan.fields.push_back({"nor:normalX", "single", numbers(0, 0.001), 0, 0, 1, 0, ""});
  return scan;
}

E57Scan integers() {
  E57Scan scan;
  scan.fields.push_back({"rowIndex", "integer", numbers(0, 1), 0, 1023, 1, 0, ""});
  scan.fields.push_back({"cartesianX", "scaled", numbers(-500, 1), -70000, 60000, 0.001, 100, ""});          // 17 bits
  scan.fields.push_back({"cartesianY", "scaled", numbers(-400, 1), -1000000000, 1000000000, 0.002, 0, ""});  // 31 bits
  scan.fields.push_back({"columnIndex", "integer", std::vector<double>(kPoints, 5), 5, 5, 1, 0, ""});        // none
  scan.fields.push_back({"cartesianZ", "integer", numbers(-300, 1), -1000, 1000, 1, 0, ""});                 // 11 bits
  std::vector<double> state(kPoints);
  for (std::size_t i = 0; i < kPoints; i += 10) state[i] = 1 + static_cast<double>(i / 10 % 2);
  scan.fields.push_back({"cartesianInvalidState", "integer", state, 0, 2, 1, 0, ""});
  return scan;
}

E57Scan polar() {
  E57Scan scan;
  scan.fields.push_back({"sphericalRange", "double", numbers(3, 0.01), 0, 0, 1, 0, ""});
  scan.fields.push_back({"sphericalAzimuth", "double", numbers(-3.1, 0.0062), 0, 0, 1, 0, ""});
  scan.fields.push_back({"sphericalElevation", "scaled", numbers(-700, 1), -2000, 2000, 0.0005, 0, ""});
  return scan;
}

const std::string kTurned =
    "<pose type=\"Structure\"><rotation type=\"Structure\"><w type=\"Float\">0.70710678118654757</w>"
    "<z type=\"Float\">0.70710678118654757</z></rotation><translation type=\"Structure\"><x type=\"Float\">1000</x>"
    "<y type=\"Float\">2000</y><z type=\"Float\">-7</z></translation></pose>";  // a quarter turn about z

std::array<double, 3> position(const Cloud& cloud, std::size_t i) {
  const Point& p = cloud.points[i];
  return {cloud.origin[0] + p.x, cloud.origin[1] + p.y, cloud.origin[2] + p.z};
}

Cloud parse_e57(const std::string& bytes) { return parse(bytes, "a.e57"); }

}  // namespace

TEST(E57Files, AnUntouchedCloudIsTheSameFile) {
  E57Scan turned = integers();
  turned.pose = kTurned;
  for (const auto& scans : {std::vector{floats("single")},
                            {floats("double")},
                            {integers()},
                            {polar()},
                            {floats("single"), turned, polar(), floats("double")}}) {
    for (const std::size_t piece : {5U, 97U, 4000U}) {
      const std::string file = make_e57(scans, piece);
      const Cloud cloud = parse_e57(file);
      EXPECT_EQ(cloud.points.size(), kPoints * scans.size());
      EXPECT_TRUE(image(cloud, Format::e57) == file);
    }
  }
}

TEST(E57Files, CoordinatesOfAllScansAreInOneSystem) {
  E57Scan turned = floats("double");
  turned.pose = kTurned;
  const Cloud cloud = parse_e57(make_e57({floats("double"), turned, polar(), integers()}));
  for (std::size_t i = 0; i < kPoints; ++i) {
    const double own = numbers(1, 0.25)[i];
    EXPECT_NEAR(position(cloud, i)[0], own, 1e-3);
    const auto p = position(cloud, kPoints + i);  // x to y, y to -x
    EXPECT_NEAR(p[0], 1000 - own, 1e-3);
    EXPECT_NEAR(p[1], 2000 + own, 1e-3);
    EXPECT_NEAR(p[2], own - 7, 1e-3);
    const double range = numbers(3, 0.01)[i], azimuth = numbers(-3.1, 0.0062)[i],
                 elevation = numbers(-700, 1)[i] * 0.0005;
    const auto q = position(cloud, 2 * kPoints + i);
    EXPECT_NEAR(q[0], range * std::cos(elevation) * std::cos(azimuth), 1e-3);
    EXPECT_NEAR(q[1], range * std::cos(elevation) * std::sin(azimuth), 1e-3);
    EXPECT_NEAR(q[2], range * std::sin(elevation), 1e-3);
    const auto r = position(cloud, 3 * kPoints + i);
    if (i % 10 == 0) {
      EXPECT_TRUE(std::isnan(r[0]) && std::isnan(r[1]) && std::isnan(r[2])) << "the file says that it means nothing";
    } else {
      EXPECT_NEAR(r[0], numbers(-500, 1)[i] * 0.001 + 100, 1e-3);
      EXPECT_NEAR(r[1], numbers(-400, 1)[i] * 0.002, 1e-3);
      EXPECT_NEAR(r[2], numbers(-300, 1)[i], 1e-3);
    }
  }
}

TEST(E57Files, AttributesOfSeveralScansAreOneColumn) {
  const Cloud cloud = parse_e57(make_e57({floats("single"), integers()}));
  const auto intensity = values<std::int16_t>(cloud, "intensity");
  const auto row = values<std::uint16_t>(cloud, "rowIndex");
  const auto normal = values<float>(cloud, "nor:normalX");
  const auto column = values<std::uint8_t>(cloud, "columnIndex");
  const auto scan = values<std::uint32_t>(cloud, "scan");
  for (std::size_t i = 0; i < kPoints; ++i) {
    EXPECT_EQ(intensity[i], numbers(-3, 1)[i]);
    EXPECT_EQ(intensity[kPoints + i], 0);  // which that scan does not have
    EXPECT_EQ(row[kPoints + i], numbers(0, 1)[i]);
    EXPECT_EQ(column[kPoints + i], 5);
    EXPECT_FLOAT_EQ(normal[i], static_cast<float>(numbers(0, 0.001)[i]));
    EXPECT_TRUE(std::isnan(normal[kPoints + i]));
    EXPECT_EQ(scan[i], 0U);
    EXPECT_EQ(scan[kPoints + i], 1U);
  }
}

TEST(E57Files, WhatSomeScansLackAndTextAreTold) {
  E57Scan labelled = floats("single");
  labelled.fields.push_back({"label", "string", numbers(0, 1), 0, 1023, 1, 0, ""});
  const Cloud cloud = parse_e57(make_e57({labelled, integers()}));
  const std::vector<std::string> lost = losses(cloud, Format::csv);
  const auto told = [&](const std::string& what) {
    return std::ranges::any_of(lost, [&](const std::string& sentence) { return sentence.ends_with(what); });
  };
  EXPECT_TRUE(told("no place for the column of words 'label'"));
  EXPECT_TRUE(told("the absence of 'intensity', 'rowIndex', 'columnIndex' in some scans, whose points get 0"));
  EXPECT_TRUE(losses(cloud).empty());
}

// The whole file is what the generator makes of the moved coordinates.
TEST(E57Files, OnlyTheBitsOfMovedCoordinatesChange) {
  for (const std::size_t piece : {5U, 97U, 4000U}) {
    for (const char* type : {"single", "double"}) {
      std::vector<E57Scan> scans = {floats(type), integers(), floats(type)};
      Cloud cloud = parse_e57(make_e57(scans, piece));
      for (std::size_t s = 0; s < scans.size(); ++s) {
        for (std::size_t i = 0; i < kPoints; ++i) {
          if (i % 3 == 0 || (s == 1 && i % 10 == 0)) continue;
          Point& p = cloud.points[s * kPoints + i];
          p.x += 0.5F;
          p.z -= 2;
          const std::size_t x = s == 1 ? 1 : 0, z = s == 1 ? 4 : 2;
          scans[s].fields[x].values[i] += s == 1 ? 500 : 0.5;  // in units of its scale
          scans[s].fields[z].values[i] -= 2;
        }
      }
      EXPECT_TRUE(image(cloud, Format::e57) == make_e57(scans, piece)) << type << " " << piece;
    }
  }
}

TEST(E57Files, APoseIsUndoneForMovedPoints) {
  E57Scan scan = floats("double");
  scan.pose = kTurned;
  Cloud cloud = parse_e57(make_e57({scan}));
  for (std::size_t i = 0; i < kPoints; i += 2) cloud.points[i].y += 0.125F;  // along the scan's own x
  const Cloud again = parse_e57(image(cloud, Format::e57));
  for (std::size_t i = 0; i < kPoints; ++i) {
    scan.fields[0].values[i] += i % 2 == 0 ? 0.125 : 0;
    EXPECT_NEAR(position(again, i)[0], 1000 - scan.fields[1].values[i], 1e-3);
    EXPECT_NEAR(position(again, i)[1], 2000 + scan.fields[0].values[i], 1e-3);
  }
}

TEST(E57Files, SphericalCoordinatesMoveAsTheyAreStored) {
  Cloud cloud = parse_e57(make_e57({polar()}));
  const Cloud before = cloud;
  for (std::size_t i = 0; i < kPoints; i += 2) {
    cloud.points[i].x += 0.05F;
    cloud.points[i].y -= 0.02F;
    cloud.points[i].z += 0.03F;
  }
  const std::string file = image(cloud, Format::e57);
  EXPECT_EQ(file.size(), make_e57({polar()}).size());
  const Cloud again = parse_e57(file);
  for (std::size_t i = 0; i < kPoints; ++i) {
    if (i % 2 == 1) {
      EXPECT_EQ(position(again, i), position(before, i));
      continue;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {  // half a step of the elevation, 0.00025, at a range of up to 13
      EXPECT_NEAR(position(again, i)[axis], position(cloud, i)[axis], 0.004);
    }
  }
}

TEST(E57Files, BoundsThatPointsLeaveAreWidened) {
  E57Scan scan = floats("single");
  scan.fields[0].bounds = " minimum=\"1\" maximum=\"250.75\"";
  scan.fields[1].bounds = " minimum=\"-9999\" maximum=\"9999\"";
  scan.bounds =
      "<cartesianBounds type=\"Structure\"><xMinimum type=\"Float\">1</xMinimum><xMaximum "
      "type=\"Float\">250.75</xMaximum>"
      "<zMinimum type=\"Float\"/></cartesianBounds>";
  const std::string before = make_e57({scan});
  Cloud cloud = parse_e57(before);
  cloud.points[0].x = -12345.125F;
  cloud.points[5].z = -3.5F;
  const std::string after = image(cloud, Format::e57);
  const auto has = [&](const std::string& file, const std::string& text) {
    std::string logical;
    for (std::size_t at = 0; at < file.size(); at += 1024) logical += file.substr(at, 1020);
    return logical.find(text) != std::string::npos;
  };
  EXPECT_TRUE(has(after, "minimum=\"-12345.125\" maximum=\"250.75\""));
  EXPECT_TRUE(has(after, "<xMinimum type=\"Float\">-12345.125</xMinimum><xMaximum type=\"Float\">250.75</xMaximum>"));
  EXPECT_TRUE(has(after, "<zMinimum type=\"Float\">-3.5</zMinimum>"));
  EXPECT_TRUE(has(after, "minimum=\"-9999\" maximum=\"9999\""));
  const Cloud again = parse_e57(after);
  EXPECT_EQ(again.points[0].x, -12345.125F);
  EXPECT_EQ(again.points[5].z, -3.5F);
  EXPECT_EQ(position(again, 600), position(cloud, 600));
}

TEST(E57Files, AnIntegerStaysWithinItsRangeAndThatIsTold) {
  Cloud cloud = parse_e57(make_e57({integers()}));
  cloud.points[3].x += 0.1F;
  EXPECT_TRUE(losses(cloud).empty());
  cloud.points[1].z = 1e6F;
  cloud.points[2].z = -1e6F;
  ASSERT_EQ(losses(cloud).size(), 1U);
  EXPECT_TRUE(losses(cloud)[0].starts_with("2 points moved beyond the range that the E57 file declares"));
  EXPECT_TRUE(losses(cloud, Format::ply)[0].starts_with("PLY files have no place for"));
  const Cloud again = parse_e57(image(cloud, Format::e57));
  EXPECT_EQ(position(again, 1)[2], 1000);
  EXPECT_EQ(position(again, 2)[2], -1000);
}

TEST(E57Files, WhatCannotBeWrittenIsRefused) {
  Cloud cloud = parse_e57(make_e57({polar()}));
  cloud.added = {make_attribute("mark", ScalarType::uint8, std::vector<std::uint8_t>(kPoints))};
  expect_error(ErrorKind::file, "takes no further attributes", [&] { image(cloud, Format::e57); });
}

TEST(E57New, EveryAttributeOfAnyCloudIsReadBack) {
  const std::size_t count = 20000;  // many packets
  Cloud cloud{.origin = {500000, 4000000, 100}};
  std::vector<double> time(count);
  std::vector<std::int16_t> angle(count);
  std::vector<std::uint8_t> color(count), mark(count);
  std::vector<float> intensity(count), normals(3 * count);
  std::vector<std::int32_t> id(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto v = static_cast<float>(i);
    cloud.points.push_back(i % 1000 == 7 ? Point{NAN, NAN, NAN} : Point{v / 7, -v / 3, std::sin(v)});
    time[i] = 1e9 + static_cast<double>(i) / 3;
    angle[i] = static_cast<std::int16_t>(i * 7 - 30000);
    color[i] = static_cast<std::uint8_t>(i);
    mark[i] = i % 2;
    intensity[i] = v / 20000;
    normals[3 * i + i % 3] = 1;
    id[i] = static_cast<std::int32_t>(i) - 10000;
  }
  cloud.added = {make_attribute("gps_time", ScalarType::float64, time),
                 make_attribute("angle", ScalarType::int16, angle),
                 make_attribute("red", ScalarType::uint8, color),
                 make_attribute("green", ScalarType::uint8, color),
                 make_attribute("blue", ScalarType::uint8, mark),
                 make_attribute("intensity", ScalarType::float32, intensity),
                 make_attribute("normal", ScalarType::float32, normals, 3),
                 make_attribute("3 odd/name", ScalarType::int32, id)};
  const std::string file = image(cloud, Format::e57);
  EXPECT_EQ(image(cloud, Format::e57), file);  // no time, no chance
  const Cloud back = parse_e57(file);
  ASSERT_EQ(back.points.size(), count);
  for (std::size_t i = 0; i < count; ++i) {
    if (std::isnan(cloud.points[i].x)) {
      EXPECT_TRUE(std::isnan(back.points[i].x));
      continue;
    }
    const auto a = position(cloud, i), b = position(back, i);
    for (std::size_t axis = 0; axis < 3; ++axis) ASSERT_NEAR(a[axis], b[axis], 1e-3);
  }
  EXPECT_EQ(values<double>(back, "timeStamp"), time);
  EXPECT_EQ(values<std::int16_t>(back, "angle"), angle);
  EXPECT_EQ(values<std::uint8_t>(back, "colorRed"), color);
  EXPECT_EQ(values<std::uint8_t>(back, "colorBlue"), mark);
  EXPECT_EQ(values<float>(back, "intensity"), intensity);
  EXPECT_EQ(values<std::int32_t>(back, "_3_odd_name"), id);
  const std::vector<float> x = values<float>(back, "nor:normalX");
  for (std::size_t i = 0; i < count; ++i) ASSERT_EQ(x[i], normals[3 * i]);
}

TEST(E57New, IntegersBeyondThoseOfE57AreDoubles) {
  const Cloud csv = parse("x,y,z,t\n1,2,3,18446744073709551615\n4,5,6,7\n", "a.csv");
  const Cloud cloud = parse(image(csv, Format::e57), "a.e57");
  EXPECT_EQ(values<double>(cloud, "t"), (std::vector<double>{18446744073709551616.0, 7}));
}

TEST(E57New, SmallCloudsAndFloatsStayWhatTheyAre) {
  for (const std::size_t count :
       {std::size_t{1}, std::size_t{7}, std::size_t{8}, std::size_t{5461}, std::size_t{5462}}) {
    Cloud cloud;
    for (std::size_t i = 0; i < count; ++i) cloud.points.push_back({static_cast<float>(i), 0.1F, -3});
    const std::string file = image(cloud, Format::e57);
    EXPECT_EQ(file.size() % 1024, 0U);
    const Cloud back = parse_e57(file);
    ASSERT_EQ(back.points.size(), count);
    EXPECT_EQ(std::memcmp(back.points.data(), cloud.points.data(), count * sizeof(Point)), 0);
    EXPECT_EQ(image(back, Format::e57), file);
  }
}

TEST(E57Errors, AFullDiskIsNamedWithTheBytesThatAreNeeded) {
  const Folder folder;
  const std::string file = make_e57({floats("double")});
  put_file(folder / "in.e57", file);
  Cloud cloud = read(folder / "in.e57");
  cloud.points[1].x += 0.5F;
  const Thrown thrown = thrown_with_room_for(file.size() / 2, [&] { write(folder / "out.e57", cloud); });
  EXPECT_EQ(thrown.kind, ErrorKind::file);
  EXPECT_NE(thrown.message.find("needs " + std::to_string(file.size()) + " bytes"), std::string::npos)
      << thrown.message;
  EXPECT_EQ(folder.names(), std::vector<std::string>{"in.e57"});
}

TEST(E57Errors, EveryTruncatedPrefixIsRefused) {
  const std::string file = make_e57({floats("single")});
  for (std::size_t size = 0; size < file.size(); size += 1 + size / 50) refusal(file.substr(0, size), "a.e57");
}

TEST(E57Errors, ADamagedPageIsNamed) {
  const std::string file = make_e57({floats("single")});
  for (std::size_t at = 48; at < file.size(); at += 700) {
    std::string bad = file;
    bad[at] = static_cast<char>(bad[at] ^ 4);
    const std::string page = std::to_string(at / 1024 * 1024);
    expect_refused(bad, "a.e57", "bytes " + page);
  }
}

TEST(E57Errors, DamagedContentsDoNoHarm) {
  std::mt19937 random(3);
  const std::string file = make_e57({integers(), polar()});
  std::string logical;
  for (std::size_t at = 0; at < file.size(); at += 1024) logical += file.substr(at, 1020);
  for (int round = 0; round < 2000; ++round) {
    std::string bad = logical;
    for (int n = 0; n < 4; ++n) bad[random() % bad.size()] = static_cast<char>(random());
    try {
      Cloud cloud = parse_e57(e57_pages(bad));
      for (const AttributeInfo& info : attributes(cloud)) attribute(cloud, info.name);
      for (Point& p : cloud.points) p.x += 1;
      image(cloud, Format::e57);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::file) << error.what();
    }
  }
}

}  // namespace pointfair::test
