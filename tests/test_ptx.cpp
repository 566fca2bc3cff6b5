// SPDX-License-Identifier: Apache-2.0
// PTX files: scans with poses as one cloud, and back. The oracle turns and shifts points with Eigen.
#include <Eigen/Geometry>
#include <cmath>
#include <random>

#include "io_files.h"
#include "pointfair/file_info.hpp"
#include "pointfair/viewpoint.hpp"

namespace pointfair::test {
namespace {

struct Scan {
  Eigen::Affine3d pose = Eigen::Affine3d::Identity();
  std::vector<Eigen::Vector3d> points;  // as the scanner has them, at most 3 decimals
  bool colored = false;
  std::size_t rows = 1;
};

std::string digits(double value) {
  char text[64];
  std::snprintf(text, sizeof text, "%.17g", value);
  return text;
}

// Where the scan's axes point stands in rows: PTX multiplies from the left.
std::string header(const Scan& scan) {
  const Eigen::Matrix4d m = scan.pose.matrix();
  std::string text = std::to_string(scan.points.size() / scan.rows) + "\n" + std::to_string(scan.rows) + "\n";
  const auto row = [&](int column, int count) {
    for (int i = 0; i < count; ++i) {
      if (i > 0) text += ' ';
      text += digits(m(i, column));
    }
    text += "\n";
  };
  for (const int column : {3, 0, 1, 2}) row(column, 3);
  for (const int column : {0, 1, 2, 3}) row(column, 4);
  return text;
}

std::string ptx(const std::vector<Scan>& scans) {
  std::string text;
  for (const Scan& scan : scans) {
    text += header(scan);
    for (std::size_t i = 0; i < scan.points.size(); ++i) {
      char row[160];
      const Eigen::Vector3d& p = scan.points[i];
      int length = std::snprintf(row, sizeof row, "%.3f %.3f %.3f %.6f", p.x(), p.y(), p.z(), double(i % 100) / 100);
      if (scan.colored)
        length += std::snprintf(row + length, sizeof row - std::size_t(length), " %d %d %d", int(i % 256), 7, 255);
      text.append(row, std::size_t(length));
      text += "\n";
    }
  }
  return text;
}

std::vector<Eigen::Vector3d> sphere(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Eigen::Vector3d> points(count);
  for (Eigen::Vector3d& p : points) {
    p = 4 * Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized();
    for (double& c : p) c = std::round(c * 1000) / 1000;
  }
  return points;
}

std::vector<Scan> two_scans() {
  Scan a, b;
  a.pose =
      Eigen::Translation3d(500000.25, 4000000.5, 100) * Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, 3).normalized());
  b.pose = Eigen::Translation3d(500010, 4000000, 101) * Eigen::AngleAxisd(-2.1, Eigen::Vector3d(0, 0, 1));
  a.points = sphere(600, 1);
  a.rows = 20;
  b.points = sphere(400, 2);
  b.colored = true;
  a.points[5] = b.points[7] = Eigen::Vector3d::Zero();
  return {a, b};
}

Eigen::Vector3d shared(const Cloud& cloud, std::size_t i) {
  const Point& p = cloud.points[i];
  return {cloud.origin[0] + p.x, cloud.origin[1] + p.y, cloud.origin[2] + p.z};
}

}  // namespace

TEST(Ptx, ThePointsOfAllScansAreInOneFrame) {
  const std::vector<Scan> scans = two_scans();
  const Cloud cloud = parse(ptx(scans), "scan.ptx");
  ASSERT_EQ(cloud.points.size(), 1000U);
  std::vector<Position> exact(1000);
  positions(cloud, exact);
  std::size_t i = 0;
  for (const Scan& scan : scans) {
    for (const Eigen::Vector3d& own : scan.points) {
      if (own.isZero()) {
        EXPECT_TRUE(std::isnan(cloud.points[i].x) && std::isnan(cloud.points[i].y) && std::isnan(cloud.points[i].z));
      } else {
        const Eigen::Vector3d expected = scan.pose * own;
        for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(exact[i][std::size_t(axis)], expected[axis], 2e-9);
        EXPECT_LT((shared(cloud, i) - expected).norm(), 1e-5);
      }
      ++i;
    }
  }
}

TEST(Ptx, IntensityColoursAndScansAreAttributes) {
  const Cloud cloud = parse(ptx(two_scans()), "scan.ptx");
  const std::vector<float> intensity = values<float>(cloud, "intensity");
  const std::vector<float> red = values<float>(cloud, "red"), blue = values<float>(cloud, "blue");
  const std::vector<std::uint32_t> scan = values<std::uint32_t>(cloud, "scan");
  for (std::size_t i = 0; i < 1000; ++i) {
    const bool second = i >= 600;
    const std::size_t place = second ? i - 600 : i;
    EXPECT_EQ(intensity[i], static_cast<float>(static_cast<double>(place % 100) / 100));
    EXPECT_EQ(scan[i], second ? 1U : 0U);
    if (second) {
      EXPECT_EQ(red[i], static_cast<float>(place % 256));
      EXPECT_EQ(blue[i], 255);
    } else {  // not black: it has none
      EXPECT_TRUE(std::isnan(red[i]) && std::isnan(blue[i]));
    }
  }
  EXPECT_EQ(losses(cloud, Format::ply)[0].find("600 points without a colour become white"), 0U);
}

TEST(Ptx, ScansMayHaveColoursInThePlaceOfIntensities) {
  const std::string start = header(Scan{.points = sphere(1, 1)}), first = start + "1 2 3 0.5\n" + start;
  Cloud cloud = parse(first + "4 5 6 10 20 30\n", "scan.ptx");
  EXPECT_EQ(values<float>(cloud, "intensity")[0], 0.5F);
  EXPECT_TRUE(std::isnan(values<float>(cloud, "intensity")[1]) && std::isnan(values<float>(cloud, "red")[0]));
  EXPECT_EQ(values<float>(cloud, "red")[1], 10);
  EXPECT_EQ(values<float>(cloud, "blue")[1], 30);
  cloud.added = {make_attribute("blue", ScalarType::float32, std::vector<float>{7, 8})};
  EXPECT_EQ(image(cloud, Format::ptx), first + "4 5 6 10 20 8\n");
}

TEST(Ptx, TheScanOfAPointIsNoValueOfItsRow) {
  Cloud cloud = parse(ptx(two_scans()), "scan.ptx");
  cloud.added = {make_attribute("scan", ScalarType::uint32, std::vector<std::uint32_t>(1000, 7))};
  expect_error(ErrorKind::usage, "by where it stands", [&] { image(cloud, Format::ptx); });
}

TEST(Ptx, TheScannersStoodWhereTheHeadersSay) {
  const std::vector<Scan> scans = two_scans();
  const std::vector<Position> places = file_viewpoints(parse(ptx(scans), "scan.ptx"));
  ASSERT_EQ(places.size(), 1000U);
  for (std::size_t i = 0; i < 1000; ++i)
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(places[i][std::size_t(axis)], scans[i < 600 ? 0 : 1].pose.translation()[axis], 1e-9);
  Scan unplaced{.points = sphere(10, 3)};
  EXPECT_TRUE(file_viewpoints(parse(ptx({unplaced}), "scan.ptx")).empty());
}

TEST(Ptx, AnUntouchedFileComesBackByteForByte) {
  std::string text = ptx(two_scans());
  EXPECT_EQ(image(parse(text, "scan.ptx"), Format::ptx), text);
  text.insert(text.find('\n', 700) + 1, " \n");  // a blank line between points
  EXPECT_EQ(image(parse(text, "scan.ptx"), Format::ptx), text);
  std::string dos;
  for (const char c : text) dos += c == '\n' ? std::string("\r\n") : std::string(1, c);
  EXPECT_EQ(image(parse(dos, "scan.ptx"), Format::ptx), dos);
  text.pop_back();
  EXPECT_EQ(image(parse(text, "scan.ptx"), Format::ptx), text);
}

TEST(Ptx, MovedPointsGoBackThroughThePoseAndNothingElseChanges) {
  const std::vector<Scan> scans = two_scans();
  const std::string text = ptx(scans);
  Cloud cloud = parse(text, "scan.ptx");
  for (std::size_t i = 0; i < cloud.points.size(); i += 3) cloud.points[i].y += 0.125F;
  const std::string moved = image(cloud, Format::ptx);
  const Cloud again = parse(moved, "scan.ptx");
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    if (std::isnan(cloud.points[i].x)) {
      EXPECT_TRUE(std::isnan(again.points[i].x));
      continue;
    }
    const Scan& scan = scans[i < 600 ? 0 : 1];
    const Eigen::Vector3d own = scan.points[i < 600 ? i : i - 600];
    EXPECT_LT((shared(again, i) - shared(cloud, i)).norm(), 1e-5);
    EXPECT_NEAR(((scan.pose * own) - shared(again, i)).norm(), i % 3 == 0 ? 0.125 : 0, 1e-5);
  }
  // line by line: headers, unmoved points and what follows the coordinates
  std::istringstream before(text), after(moved);
  std::size_t line = 0;
  for (std::string a, b; std::getline(before, a); ++line) {
    ASSERT_TRUE(std::getline(after, b));
    const bool in_first = line < 610;
    const std::size_t point = in_first ? line - 10 : line - 20;
    const bool is_header = line < 10 || (line >= 610 && line < 620);
    if (is_header || point % 3 != 0 || std::isnan(cloud.points[point].x)) {
      ASSERT_EQ(a, b) << line;
    } else {
      const auto rest = [](const std::string& row) {
        std::size_t at = 0;
        for (int word = 0; word < 3; ++word) at = row.find(' ', at) + 1;
        return row.substr(at);
      };
      ASSERT_EQ(rest(a), rest(b)) << line;
      ASSERT_LT(b.size(), a.size() + 24) << b;  // digits that mean nothing are left out
    }
  }
}

TEST(Ptx, PointsThatGetOrLoseAPlace) {
  Cloud cloud = parse(ptx(two_scans()), "scan.ptx");
  std::vector<Position> placed(cloud.points.size());
  positions(cloud, placed);
  placed[5] = {500001, 4000001, 99};  // was invalid
  placed[6].fill(NAN);
  set_positions(cloud, placed);
  const Cloud again = parse(image(cloud, Format::ptx), "scan.ptx");
  std::vector<Position> read_back(again.points.size());
  positions(again, read_back);
  for (int axis = 0; axis < 3; ++axis) EXPECT_NEAR(read_back[5][std::size_t(axis)], placed[5][std::size_t(axis)], 1e-8);
  EXPECT_TRUE(std::isnan(read_back[6][0]));
}

TEST(Ptx, ACloudOfAnotherFormatBecomesOneScan) {
  const Cloud ply = parse(
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "property float intensity\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nproperty int id\n"
      "end_header\n1.5 2 3 0.25 1 2 3 4\nnan 0 0 0.75 5 6 7 8\n-0.1 0 0 1 9 10 11 12\n");
  const std::string text = image(ply, Format::ptx);
  EXPECT_EQ(text,
            "3\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
            "1.5 2 3 0.25 1 2 3\n0 0 0 0.75 5 6 7\n-0.1 0 0 1 9 10 11\n");
  EXPECT_EQ(parse(text, "misnamed.xyz").points.size(), 3U);
  EXPECT_EQ(losses(ply, Format::ptx).size(), 1U);                                  // id
  EXPECT_FALSE(losses(parse(ptx(two_scans()), "scan.ptx"), Format::ply).empty());  // poses
}

TEST(Ptx, EveryPrefixIsReadOrRefusedInOneLine) {
  std::vector<Scan> scans = two_scans();
  for (Scan& scan : scans) {
    scan.points.resize(6);
    scan.rows = 2;
  }
  const std::string text = ptx(scans);
  for (std::size_t size = 1; size < text.size(); ++size) {
    try {
      EXPECT_GE(parse(text.substr(0, size), "cut.ptx", Format::ptx).points.size(), 6U);
    } catch (const Error& error) {
      EXPECT_EQ(error.kind(), ErrorKind::file);
      EXPECT_EQ(std::string(error.what()).find('\n'), std::string::npos);
    }
  }
}

TEST(Ptx, DamagedFilesAreRefused) {
  const std::string sound = ptx({two_scans()[1]});
  const auto refused = [&](const std::string& from, const std::string& to, const std::string& says) {
    std::string text = sound;
    text.replace(text.find(from), from.size(), to);
    EXPECT_PRED_FORMAT2(testing::IsSubstring, says, refusal(text, "scan.ptx", Format::ptx));
  };
  refused("400\n", "401\n", "the file ends after 400");
  refused("400\n", "399\n", "scan 2");
  refused("400\n", "18446744073709551615\n", "the file ends after");
  refused("400\n", "0\n", "");
  refused("\n0 0 1 0\n", "\n0 0 1 2\n", "line 9");
  refused("0.000 0.000 0.000 0.070000", "0.000 q 0.000 0.070000", "line 18: 'q' is not a number; repair the line");
  refused("0.000 0.000 0.000 0.070000 7 7 255", "1 2", "line 18: too few values: '1 2'; points need x, y and z");
  refusal("1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n1 0 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 1\n", "a.ptx");
}

}  // namespace pointfair::test
