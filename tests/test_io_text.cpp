// SPDX-License-Identifier: Apache-2.0
// Columns of numbers: separators, headers, names and types of columns; OFF and OBJ.
#include <malloc.h>
#include <tbb/task_arena.h>

#include <bit>
#include <cmath>
#include <random>

#include "io/plain_row.hpp"
#include "io/source.hpp"
#include "io/text.hpp"
#include "io_files.h"

namespace pointfair::test {
namespace {

std::vector<std::string> names(const Cloud& cloud) {
  std::vector<std::string> result;
  for (const AttributeInfo& info : attributes(cloud)) result.push_back(info.name);
  return result;
}
using Names = std::vector<std::string>;

}  // namespace

TEST(FilesText, NumbersAreReadAsWritten) {
  for (const auto& [word, value] : std::vector<std::pair<std::string, double>>{{"1", 1},
                                                                               {"-0.5", -0.5},
                                                                               {"+3", 3},
                                                                               {".25", 0.25},
                                                                               {"4.", 4},
                                                                               {"1e-3", 1e-3},
                                                                               {"1E5", 1e5},
                                                                               {"0.1", 0.1},
                                                                               {"5334567.891", 5334567.891},
                                                                               {"1e999", INFINITY},
                                                                               {"-inf", -INFINITY}}) {
    ASSERT_TRUE(io::to_number(word)) << word;
    EXPECT_EQ(*io::to_number(word), value) << word;
  }
  EXPECT_TRUE(std::isnan(*io::to_number("nan")));
  for (const char* word : {"", "+", "-", "1x", "0x10", "1,5", "one", "1e", "+-1", "--1", "."})
    EXPECT_FALSE(io::to_number(word)) << word;
}

TEST(FilesText, AMovedNumberLosesNoDigit) {
  const auto moved = [](const std::string& word, double value, float offset) {
    std::string text;
    io::append_moved(text, word, value, offset);
    return text;
  };
  EXPECT_EQ(moved("1.0", 1.5, 1.5F), "1.5");
  EXPECT_EQ(moved("1.000", 1.5, 1.5F), "1.500");
  EXPECT_EQ(moved("1", 2, 2), "2");
  EXPECT_EQ(moved("1e0", 1.5, 1.5F), "1.5");
  EXPECT_EQ(moved("0.1", 0, 0), "0");
  EXPECT_EQ(moved("691234.567", 691234.56825, 0.56825F), "691234.56825");
  // Read back, the float nearest to the number is the offset.
  for (int i = 1; i < 2000; ++i) {
    const float offset = std::sin(static_cast<float>(i)) * std::pow(10.0F, static_cast<float>(i % 12 - 6));
    EXPECT_EQ(static_cast<float>(*io::to_number(moved("0.1", static_cast<double>(offset), offset))), offset);
  }
}

TEST(FilesText, EverySeparatorIsUnderstood) {
  for (const char* line :
       {"1 2.5 -3 7", "1\t2.5\t-3\t7", "1,2.5,-3,7", "1;2.5;-3;7", "  1 ,\t2.5 ,-3,7 ", "1 2.5 -3   7\r"}) {
    SCOPED_TRACE(line);
    const std::string text = std::string(line) + "\n" + line;
    for (const char* name : {"a.xyz", "a.txt", "a.csv"}) {
      const Cloud cloud = parse(text, name);
      ASSERT_EQ(cloud.points.size(), 2U);
      EXPECT_EQ(cloud.points[1].y, 2.5F);
      EXPECT_EQ(cloud.points[1].z, -3);
      EXPECT_EQ(values<std::uint8_t>(cloud, "column_4")[1], 7);
    }
  }
}

TEST(FilesText, NamesComeFromAHeaderOrARemark) {
  EXPECT_EQ(names(parse("z,y,x,time\n1,2,3,4\n", "a.csv")), Names{"time"});
  EXPECT_EQ(parse("z,y,x,time\n1,2,3,4\n", "a.csv").points[0].x, 3);
  EXPECT_EQ(names(parse("\"X\",\"Y\",\"Z\",\"a b\"\n1,2,3,4\n", "a.csv")), Names{"a b"});
  EXPECT_EQ(names(parse("//X Y Z R G B\n1 2 3 4 5 6\n", "a.asc")), (Names{"R", "G", "B"}));
  EXPECT_EQ(names(parse("# x y z quality\n1 2 3 4\n", "a.xyz")), Names{"quality"});
  EXPECT_EQ(names(parse("# just a remark\n1 2 3 4\n", "a.xyz")), Names{"column_4"});
  EXPECT_EQ(names(parse("\xEF\xBB\xBFx,y,z\n1,2,3\n", "a.csv")), Names{});
  EXPECT_EQ(names(parse("1\n1 2 3 4 5 6 7\n", "a.pts")), (Names{"intensity", "red", "green", "blue"}));
  EXPECT_EQ(names(parse("1 2 3 4 5 6\n", "a.pts")), (Names{"red", "green", "blue"}));
}

TEST(FilesText, AColumnHasTheNarrowestTypeThatHoldsIt) {
  const Cloud cloud = parse(
      "x,y,z,byte,whole,real,fine,word,part\n1,2,3,255,-7,0.5,0.123456789012,a,\n4,5,6,0,70000,"
      "123.25,1,b,2\n",
      "a.csv");
  const auto infos = attributes(cloud);
  ASSERT_EQ(infos.size(), 5U);  // words are no numbers
  EXPECT_EQ(infos[0].type, ScalarType::uint8);
  EXPECT_EQ(infos[1].type, ScalarType::int32);
  EXPECT_EQ(infos[2].type, ScalarType::float32);
  EXPECT_EQ(infos[3].type, ScalarType::float64);
  EXPECT_EQ(infos[4].type, ScalarType::float32);
  EXPECT_TRUE(std::isnan(values<float>(cloud, "part")[0]));
  EXPECT_EQ(values<double>(cloud, "fine")[0], 0.123456789012);
}

TEST(FilesText, CoordinatesBecomeDoublesOnlyIfAFloatWouldLoseADigit) {
  EXPECT_EQ(parse("1.25 2.5 3\n0.1 0.2 0.3\n", "a.xyz").source->coordinate_type(), ScalarType::float32);
  EXPECT_EQ(parse("12.345678 2.5 3\n", "a.xyz").source->coordinate_type(), ScalarType::float32);
  EXPECT_EQ(parse("123.4567891 2.5 3\n0 0 0\n", "a.xyz").source->coordinate_type(), ScalarType::float64);
}

TEST(FilesText, NumbersWithExponentsKeepTheirDigits) {
  const Cloud cloud = parse("x y z time short double\n1 2 3 4.123456781234560013e+08 1.234e+05 1.5D-3\n", "a.txt");
  EXPECT_EQ(values<double>(cloud, "time")[0], 412345678.123456);
  EXPECT_EQ(attributes(cloud)[1].type, ScalarType::float32);
  EXPECT_EQ(attributes(cloud)[2].type, ScalarType::float32);
  EXPECT_EQ(parse("1.53e+00 1.700000000000000178e+00 0\n", "a.txt").source->coordinate_type(), ScalarType::float64);
}

TEST(FilesText, ColumnsOfAnOffFileHaveTheirNames) {
  const Cloud cloud = parse("CNOFF\n1 0 0\n0 0 0 0 0 1 255 128 0 255 # a remark\n", "a.off");
  EXPECT_EQ(names(cloud), (Names{"nx", "ny", "nz", "red", "green", "blue", "alpha"}));
  EXPECT_EQ(values<std::uint8_t>(cloud, "green")[0], 128);
}

TEST(FilesText, TabsStayTabs) {
  Cloud cloud = parse("1\t2\t3\n", "a.txt");
  cloud.added = {make_attribute<int>("n", ScalarType::int32, {7})};
  EXPECT_EQ(image(cloud, Format::txt), "1\t2\t3\t7\n");
}

TEST(FilesText, AddedNamesGoToTheHeader) {
  Cloud cloud = parse("//X;Y;Z\r\n1;2;3\r\n", "a.txt");
  cloud.added = {make_attribute<float>("normal", ScalarType::float32, {0, 0, 1}, 3)};
  EXPECT_EQ(image(cloud, Format::txt), "//X;Y;Z;nx;ny;nz\r\n1;2;3;0;0;1\r\n");
}

namespace {

// A line of /proc/self/status, in bytes.
std::size_t memory_status(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);)
    if (line.starts_with(key)) return 1024 * std::stoul(line.substr(key.size() + 1));
  return 0;
}

std::string repeated(const std::string& row, std::size_t count) {
  std::string text;
  for (std::size_t i = 0; i < count; ++i) text += row;
  return text;
}

}  // namespace

namespace {

using NamedBytes = std::pair<const char*, std::string>;

// Files of so many points, with rows as scanners write them.
std::vector<NamedBytes> files_of(std::size_t points, const std::string& x, const std::string& y, const std::string& z) {
  const std::string row = x + " " + y + " " + z, count = std::to_string(points), rows = repeated(row + "\n", points),
                    scan = "\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n",
                    xyz = "property float x\nproperty float y\nproperty float z\n", csv = x + "," + y + "," + z;
  return {{"a.xyz", rows},
          {"a.csv", "x,y,z\n" + repeated(csv + "\n", points)},
          {"with_i.csv", "x,y,z,i\n" + repeated(csv + ",7\n", points)},
          {"a.pts", count + "\n" + repeated(row + " 7\n", points)},
          {"colors.pts", count + "\n" + repeated(row + " 7 1 2 3\n", points)},
          {"a.off", "OFF\n" + count + " 0 0\n" + rows},
          {"wrapped.off", "OFF\n" + count + " 0 0\n" + repeated(row + " " + row + "\n", points / 2)},
          {"a.obj", repeated("v " + row + "\n", points)},
          {"a.ply", "ply\nformat ascii 1.0\nelement vertex " + count + "\n" + xyz + "end_header\n" + rows},
          {"a.pcd", "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS " + count + "\nDATA ascii\n" + rows},
          {"a.ptx", count + scan + repeated(row + " 0.5\n", points)},
          {"colors.ptx", count + scan + repeated(row + " 0.5 1 2 3\n", points)}};
}

// Each thread holds up to 2 MiB of the file.
constexpr int kThreads = 2;

// Meshes whose lines are hardly longer than what is made of them.
std::vector<NamedBytes> short_meshes(std::size_t faces) {
  const std::string points = repeated("v 1 2 3\n", 10), many = repeated("v 1 2 3\n", faces / 2),
                    count = std::to_string(faces), rows = repeated("1 2 3\n", 10),
                    normals = repeated("vn 0 0 1\n", faces / 2);
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 10\nproperty float x\nproperty float y\nproperty float z\n"
      "element face " +
      count + "\nproperty list uchar int vertex_indices\nend_header\n";
  return {{"triangles.obj", points + repeated("f 1 2 3\n", faces)},
          {"quads.obj", points + repeated("f 1 2 3 4\n", faces)},
          {"both.obj", points + repeated("f 1 2 3\n", faces) + repeated("f 1 2 3 4\n", faces)},
          {"texture.obj", points + "vt 0 0\n" + repeated("f 1/1 2/1 3/1\n", faces)},
          {"normals.obj", many + normals + repeated("f 1//1 2//1 3//1\n", faces)},
          {"as_many_points.obj", many + repeated("f 1 2 3\n", faces)},
          {"triangles.off", "OFF\n10 " + count + " 0\n" + rows + repeated("3 1 2 3\n", faces)},
          {"quads.off", "OFF\n10 " + count + " 0\n" + rows + repeated("4 1 2 3 4\n", faces)},
          {"triangles.ply", ply + rows + repeated("3 1 2 3\n", faces)}};
}

void expect_three_times(const std::vector<NamedBytes>& files, std::size_t points) {
  const Folder folder;
  for (const auto& [name, bytes] : files) {
    put_file(folder / name, bytes);
    ::malloc_trim(0);  // what earlier clouds left would hide what this one takes
    if (!(std::ofstream("/proc/self/clear_refs") << 5 << std::flush)) GTEST_SKIP() << "the peak cannot be reset";
    const std::size_t before = memory_status("VmRSS:");
    ReadOptions options{.threads = kThreads};
    tbb::task_arena(kThreads).execute([&] {
      const Cloud cloud = read(folder / name, options);
      for (const AttributeInfo& info : attributes(cloud)) attribute(cloud, info.name);
      losses(cloud, Format::npy);
      polygons(cloud);
      ::malloc_trim(0);  // or what the polygons took stays with the heap beside the triangles
      triangles(cloud);
    });
    const std::size_t peak = memory_status("VmHWM:");
    EXPECT_GE(peak, before + 12 * points);  // the points, at least
    // the half of a piece more is what a thread still holds that has to wait on a busy machine
    EXPECT_LE(static_cast<double>(peak - before), 3.0 * static_cast<double>(bytes.size()) + (1 << 20)) << name;
    std::filesystem::remove(folder / name);
  }
}

}  // namespace

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
TEST(FilesText, DISABLED_ReadingTakesNoMoreThanThreeTimesTheFile) {
#else
TEST(FilesText, ReadingTakesNoMoreThanThreeTimesTheFile) {
#endif
  constexpr std::size_t kRows = 300000, kShortRows = 2000000;
  std::vector<NamedBytes> files = files_of(kRows, "123.4567", "-23.4567", "3.45678");
  const std::string row = "123.4567 -23.4567 3.45678\n", count = std::to_string(kRows);
  files.emplace_back("faces.off",
                     "OFF\n" + count + " " + count + " 0\n" + repeated(row, kRows) + repeated("3 17 18 19\n", kRows));
  files.emplace_back("faces.obj", repeated("v " + row, kRows) + repeated("f 17 18 19\n", kRows));
  expect_three_times(files, kRows);
  expect_three_times(files_of(kShortRows, "1", "2", "3"), kShortRows);  // hardly longer than the points
  expect_three_times(short_meshes(kShortRows), 0);
}

// Of a row of blanks and of one of commas, in the middle, where eight characters are read at once, and at the end.
TEST(FilesText, NumbersInARowAreThoseOfTheirWords) {
  std::mt19937 random(7);
  const auto below = [&](unsigned count) { return static_cast<unsigned>(random() % count); };
  const auto digits = [&](unsigned count) {
    std::string text;
    for (; count > 0; --count) text += static_cast<char>('0' + below(10));
    return text;
  };
  std::vector<std::string> words = {"0",        "-0",       "-0.0",      ".5",  "-.5",   "5.",
                                    "00000001", "99999999", "9999999.9", "1e3", "-1E-3", "1.5e2"};
  for (int i = 0; i < 20000; ++i) {
    const std::string whole = digits(below(11)), fraction = digits(below(11));
    if (whole.empty() && fraction.empty()) continue;
    words.push_back((below(2) == 0 ? "-" : "") + whole + (fraction.empty() && below(2) == 0 ? "" : "." + fraction));
  }
  for (const std::string& word : words) {
    const double expected = io::to_number(word).value();
    for (const std::string& line :
         {word + " 7 some words behind it", word + "  7", word + "\t7 and more of the row", word + ",7"}) {
      io::PlainRow row(line, line.ends_with(",7") ? ',' : ' ');
      double value = 0, next = 0;
      ASSERT_TRUE(row.number(value) && row.number(next)) << line;
      EXPECT_EQ(std::bit_cast<std::uint64_t>(value), std::bit_cast<std::uint64_t>(expected)) << line;
      EXPECT_EQ(next, 7) << line;
    }
  }
  for (const std::string word : {"0..5", "1.2.3", "--1", "1-2", "1:2", "1/2", ".", "-", "12\"3"}) {
    const std::string line = word + " 7 some words behind it";
    io::PlainRow row(line, ' ');
    double value = 0;
    std::string_view first;
    EXPECT_FALSE(row.number(value)) << word;
    EXPECT_TRUE(row.word(first) && first == word) << word << ": is passed";
  }
}

TEST(FilesText, WordsArePassedHoweverTheyAreSeparated) {
  const auto behind = [](const std::string& line, std::size_t passed) {
    io::PlainRow row(line, ' ');
    std::string_view word;
    return row.skip(passed) && row.word(word) ? std::string(word) : "none";
  };
  EXPECT_EQ(behind("1.25 -17.123456 3 0.5 and more words", 3), "0.5");
  EXPECT_EQ(behind("1.25  -17.123456\t3\t \t0.5 and more words", 3), "0.5");
  EXPECT_EQ(behind("1 2 3 4", 3), "4");
  EXPECT_EQ(behind("1 2 3 ", 3), "none");
  EXPECT_EQ(behind("1 2 3", 3), "none");
  EXPECT_EQ(behind("1 \"2 3\" 4 5 6 and more words", 3), "none");  // a row that PlainRow leaves to others
  EXPECT_EQ(behind("1 2\\\n3 4 5 and more words of the row", 3), "none");
}

TEST(FilesText, SeveralAttributesAreReadAtOnce) {
  const std::string scan = "\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
  for (const auto& [name, bytes] : std::vector<NamedBytes>{
           {"a.csv", "x,y,z,i,\"a b\",t\n1,2,3,0.5,7,9\n4,5,6,,\"8\",10\n"},
           {"a.ptx", "2" + scan + "1 2 3 0.5 1 2 3\n4 5 6 0.25 400 5 6.5\n1" + scan + "1 2 3 0.5\n"},
           {"a.obj", "v 1 2 3 0.5 0.25 1\nv 4 5 6\nvn 0 0 1\nvn 0 1 0\nf 1//2 2//1 1//2\n"},
           {"a.ply",
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty uchar q\nproperty float y\nproperty "
            "float z\nproperty short r\nend_header\n1 7 2 3 -4\n"}}) {
    Cloud cloud = parse(bytes, name);
    cloud.added = {make_attribute("more", ScalarType::uint8, std::vector<std::uint8_t>(cloud.points.size()))};
    Names all = names(cloud);
    ASSERT_GE(all.size(), 3U) << name;
    std::swap(all.front(), all.back());
    all.push_back(all[1]);  // twice
    const std::vector<Attribute> values = attribute_values(cloud, all);
    ASSERT_EQ(values.size(), all.size());
    for (std::size_t a = 0; a < all.size(); ++a) {
      const Attribute one = attribute(cloud, all[a]);
      EXPECT_EQ(values[a].name, all[a]) << name;
      EXPECT_EQ(values[a].type, one.type) << name << all[a];
      EXPECT_EQ(values[a].data, one.data) << name << all[a];
    }
    EXPECT_TRUE(attribute_values(cloud, {}).empty());
    all.emplace_back("none");
    EXPECT_EQ(thrown_by([&] { attribute_values(cloud, all); }).kind, ErrorKind::usage);
  }
}

TEST(FilesText, AWordThatIsNoNumberIsRefusedAmongSeveralAttributes) {
  const std::string scan = "2\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 0.5 1 2 3\n";
  const std::vector<std::string> all = {"intensity", "red", "green", "blue"};
  for (const std::string row :
       {"4 5 6 0..5 1 2 3 and more words", "4 5 6 0..5 1 2 3", "4 5 6 0.5 1 2 0x3", "4 5 6 0.5 1-2 3 4"}) {
    const Cloud cloud = parse(scan + row + "\n", "a.ptx");
    EXPECT_NE(thrown_by([&] { attribute_values(cloud, all); }).message.find("line 12: "), std::string::npos) << row;
  }
}

TEST(FilesText, CornersOfAFaceMayBeWrittenInManyWays) {
  const auto corners = [](const std::string& faces) {
    return polygons(parse("v 1 2 3\nv 4 5 6\nvt 0 0\nvn 0 0 1\nv 7 8 9\n" + faces, "a.obj")).corners;
  };
  using Corners = std::vector<std::uint32_t>;
  EXPECT_EQ(corners("f 1 2 3\n"), (Corners{0, 1, 2}));
  EXPECT_EQ(corners("f -3 -2\t-1 \r\n"), (Corners{0, 1, 2}));
  EXPECT_EQ(corners("f 1/1 2//1 3/1/1\n"), (Corners{0, 1, 2}));
  EXPECT_EQ(corners("f 1/ 2// 3/1/1/7\n"), (Corners{0, 1, 2}));
  EXPECT_EQ(corners("f 1 2 \\\n3\n"), (Corners{0, 1, 2}));
  EXPECT_EQ(corners("f 1 2\\\n3\n"), (Corners{0, 1, 2}));
  EXPECT_EQ(corners("f\n"), Corners{});
  for (const std::string word :
       {"0", "-0", "4", "-4", "1x", "+1", "1/x", "/1", "1.5", "99999999999999999999", "\"\"x", "1\\2"}) {
    expect_error(ErrorKind::file, "line 6: ", [&] { corners("f 1 " + word + " 3\n"); });
  }
}

TEST(FilesText, AColumnMoreStandsBehindEmptyWords) {
  Cloud cloud = parse("x\ty\tz\tname\ti\t\n1\t2\t3\toak\t7\t\n4\t5\t6\t\t\t\n7\t8\t9\t\t\n", "a.csv");
  cloud.added = {make_attribute<std::uint8_t>("more", ScalarType::uint8, {11, 12, 13})};
  const std::string text = image(cloud, Format::csv);
  EXPECT_EQ(text, "x\ty\tz\tname\ti\tmore\t\n1\t2\t3\toak\t7\t11\t\n4\t5\t6\t\t\t12\t\n7\t8\t9\t\t\t13\n");
  EXPECT_EQ(values<std::uint8_t>(parse(text, "a.csv"), "more"), (std::vector<std::uint8_t>{11, 12, 13}));
}

}  // namespace pointfair::test
