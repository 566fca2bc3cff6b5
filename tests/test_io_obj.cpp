// SPDX-License-Identifier: Apache-2.0
// OBJ files that lose points: what is left names the same things, and all other lines stay.
#include <gtest/gtest.h>

#include <map>
#include <random>
#include <sstream>

#include "io_cases.h"

namespace pointfair::test {
namespace {

using Words = std::vector<std::string>;

Words words_in(const std::string& line, char separator) {
  Words words;
  std::istringstream in(line);
  for (std::string word; std::getline(in, word, separator);)
    if (separator == '/' || !word.empty()) words.push_back(word);
  return words;
}

// What a file says, by a plain reader of its own: numbers of lines are replaced by the lines that they name.
struct Meaning {
  Words points, others;                // lines of points; all lines but those of points, normals and elements
  std::vector<Words> elements;         // the material, the kind, and each corner as the lines that it names
  std::map<std::string, Words> lines;  // of points ("v"), texture coordinates and normals

  explicit Meaning(const std::string& text) {
    std::istringstream in(text);
    std::string material;
    for (std::string line; std::getline(in, line);) {
      const Words words = words_in(line, ' ');
      const std::string key = words.empty() ? "" : words[0];
      if (key == "v") points.push_back(line);
      if (key == "v" || key == "vt" || key == "vn") lines[key].push_back(line);
      if (key == "usemtl") material = line;
      if (key == "f" || key == "l" || key == "p") {
        elements.push_back({material, key});
        for (std::size_t w = 1; w < words.size(); ++w) elements.back().push_back(named(words[w]));
      } else if (key != "v" && key != "vn") {
        others.push_back(line);
      }
    }
  }

  std::string named(const std::string& corner) {
    static const char* const kKinds[] = {"v", "vt", "vn"};
    std::string result;
    const Words numbers = words_in(corner, '/');
    for (std::size_t n = 0; n < numbers.size(); ++n) {
      const Words& all = lines[kKinds[n]];
      if (numbers[n].empty()) continue;
      const int number = std::stoi(numbers[n]);
      result += all.at(std::size_t(number > 0 ? number - 1 : int(all.size()) + number)) + ";";
    }
    return result;
  }
};

// `own_normals`: one for each point behind it; else a few that many corners share.
std::string random_obj(std::mt19937& random, bool own_normals) {
  std::string text = "mtllib a.mtl\n";
  std::size_t points = 0, normals = 0, textures = 0;
  const auto below = [&](std::size_t count) { return std::size_t(random() % count); };
  const auto number = [&](std::size_t index, std::size_t so_far) {
    return below(3) == 0 ? std::to_string(std::int64_t(index) - std::int64_t(so_far)) : std::to_string(index + 1);
  };
  const auto corner = [&] {
    const std::size_t point = below(points);
    std::string word = number(point, points);
    const std::size_t form = below(4);  // "7", "7/1", "7//3", "7/1/3"
    if (form > 0) word += '/';
    if (form % 2 == 1) word += number(below(textures), textures);
    if (form > 1) word += '/';
    if (form > 1) word += own_normals ? number(point, normals) : number(below(normals), normals);
    return word;
  };
  for (int i = 0; i < 1500; ++i) {
    for (std::size_t left = i == 0 ? 10 : below(3); left > 0; --left) {
      text += "v " + std::to_string(points) + " " + std::to_string(below(1000)) + " 0.5\n";
      ++points;
      if (own_normals) text += "vn 0 " + std::to_string(normals++) + " 1\n";
    }
    if (i == 0 || below(20) == 0) text += "vt 0 " + std::to_string(textures++) + "\n";
    if (!own_normals && (i == 0 || below(20) == 0)) text += "vn 0 " + std::to_string(normals++) + " 1\n";
    if (below(10) == 0) text += "usemtl skin" + std::to_string(i) + "\n# remark\ng part\n\n";
    text += "f";
    for (std::size_t left = 3 + below(2); left > 0; --left) (text += ' ') += corner();
    text += "\n";
    if (below(10) == 0) text += "l " + number(below(points), points) + "  " + number(below(points), points) + "\n";
    if (below(10) == 0) text += "p " + number(below(points), points) + " " + number(below(points), points) + "\n";
  }
  return text;
}

}  // namespace

TEST(ObjFiles, WhatIsLeftOfOneThatLosesPointsNamesTheSame) {
  for (unsigned seed = 0; seed < 4; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const bool own_normals = seed % 2 == 0;
    const std::string text = random_obj(random, own_normals);
    const Cloud cloud = parse(text, "a.obj");
    std::vector<std::uint8_t> removed(cloud.points.size());
    for (std::uint8_t& gone : removed) gone = random() % 12 == 0;
    const Cloud less = without_points(cloud, removed);
    EXPECT_TRUE(losses(less).empty());
    Meaning before(text), after(image(less, Format::obj));
    std::map<std::string, bool> gone;  // by the line of a point, which is the only one of its kind
    Words points, normals;
    for (std::size_t i = 0; i < removed.size(); ++i) {
      gone[before.points[i] + ";"] = removed[i] != 0;
      if (!removed[i]) points.push_back(before.points[i]);
      if (!removed[i] && own_normals) normals.push_back(before.lines["vn"][i]);
    }
    EXPECT_EQ(after.points, points);
    EXPECT_EQ(after.lines["vn"], own_normals ? normals : before.lines["vn"]);
    EXPECT_EQ(after.others, before.others);
    std::vector<Words> left;
    for (Words element : before.elements) {
      const auto is_gone = [&](const std::string& corner) { return gone[corner.substr(0, corner.find(';') + 1)]; };
      const std::size_t corners = element.size() - 2,
                        lost = std::size_t(std::count_if(element.begin() + 2, element.end(), is_gone));
      if (element[1] == "p") element.erase(std::remove_if(element.begin() + 2, element.end(), is_gone), element.end());
      if (lost == 0 || (element[1] == "p" && lost < corners)) left.push_back(element);
    }
    EXPECT_EQ(after.elements, left);
    EXPECT_LT(left.size(), before.elements.size());
    // and it reads as the cloud that was written
    const Cloud back = parse(image(less, Format::obj), "b.obj");
    EXPECT_EQ(polygons(back).corners, polygons(less).corners);
    EXPECT_EQ(image(back, Format::csv), image(less, Format::csv));
  }
}

TEST(ObjFiles, LinesKeepWhatDoesNotChange) {
  Cloud cloud = parse(
      "mtllib a.mtl\r\nv 1 2 3 # first\r\nv 4 5 6\r\nv 7.50 8 9\r\nv 1 1 1\r\nusemtl bark\r\nf 01 3 \\\r\n  4\r\n"
      "f 1 2 3\r\nf\r\ns off\r\n  f\t-1 -2 -4\r\np 2\r\np 4 2 1\r\n# 4 points",
      "a.obj");
  cloud.points[0].y = 2.5F;
  EXPECT_EQ(image(without_points(cloud, std::vector<std::uint8_t>{0, 1, 0, 0}), Format::obj),
            "mtllib a.mtl\r\nv 1 2.5 3 # first\r\nv 7.50 8 9\r\nv 1 1 1\r\nusemtl bark\r\nf 01 2 \\\r\n  3\r\n"
            "f\r\ns off\r\n  f\t-1 -2 -3\r\np 3  1\r\n# 4 points");
  EXPECT_EQ(image(without_points(cloud, std::vector<std::uint8_t>(4)), Format::obj), image(cloud, Format::obj));
}

TEST(ObjFiles, NormalsThatCornersShareAreNotThoseOfPoints) {
  const std::string points = "v 0 0 0\nv 1 0 0\nv 5 5 5\n", normals = "vn 0 0 1\nvn 1 0 0\nvn 0 1 0\n";
  EXPECT_EQ(image(parse(points + normals + "l 1 2\nf 1//1 2//1\n", "a.obj"), Format::csv),
            "x,y,z,nx,ny,nz\n0,0,0,0,0,1\n1,0,0,0,0,1\n5,5,5,0,0,0\n");
  EXPECT_EQ(image(parse(points + normals + "f 1//1 2//2\n", "a.obj"), Format::csv),
            "x,y,z,nx,ny,nz\n0,0,0,0,0,1\n1,0,0,1,0,0\n5,5,5,0,1,0\n");
}

TEST(ObjFiles, WhatNamesPointsInOtherWaysIsWrittenAnew) {
  for (const std::string element : {"curv 0 1 1 2 3\n", "surf 0 1 0 1 1 2 3\n", "#MRGB ffffffff\n", "l 1 7\n"}) {
    const Cloud cloud = parse("v 1 2 3\nv 4 5 6\nv 7 8 9\n" + element, "a.obj");
    const Cloud less = without_points(cloud, std::vector<std::uint8_t>{0, 1, 0});
    EXPECT_EQ(image(less, Format::obj), "v 1 2 3\nv 7 8 9\n");
    EXPECT_FALSE(losses(less, Format::obj).empty());
  }
}

TEST(ObjFiles, ADamagedFaceIsNamedWhenPointsAreLeftOut) {
  const Cloud cloud = parse("v 1 2 3\nv 4 5 6\nf 1 9 2\n", "a.obj");
  const std::vector<std::uint8_t> removed{0, 1};
  EXPECT_NE(thrown_by([&] { image(without_points(cloud, removed), Format::obj); }).message.find("line 3: '9'"),
            std::string::npos);
}

}  // namespace pointfair::test
