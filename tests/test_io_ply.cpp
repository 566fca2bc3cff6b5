// SPDX-License-Identifier: Apache-2.0
// Random PLY schemas against an encoder of the plainest kind.
#include <gtest/gtest.h>
// rapidcheck needs GoogleTest before it
#include <rapidcheck/gtest.h>

#include <charconv>
#include <cmath>

#include "io_files.h"

namespace pointfair::test {
namespace {

const std::vector<std::string> kTypes = {"char", "uchar", "short", "ushort", "int", "uint", "float", "double"};

struct Property {
  std::string name;
  std::size_t type = 6;
  int count_type = -1;  // of a list
};

struct Element {
  std::string name;
  std::vector<Property> properties;
  std::vector<std::vector<std::vector<double>>> rows;  // values of each property
};

template <class T>
void encode(double value, Encoding encoding, std::string& to) {
  const T typed = static_cast<T>(value);
  if (encoding != Encoding::ascii) {
    to += packed<T>({typed}, encoding == Encoding::binary_big_endian);
    return;
  }
  char digits[64];
  if constexpr (sizeof(T) == 1) {
    to.append(digits, std::to_chars(digits, digits + 64, static_cast<int>(typed)).ptr);
  } else {
    to.append(digits, std::to_chars(digits, digits + 64, typed).ptr);
  }
  to += ' ';
}

void encode(double value, std::size_t type, Encoding encoding, std::string& to) {
  using Encode = void (*)(double, Encoding, std::string&);
  static constexpr Encode kEncoders[] = {encode<std::int8_t>,   encode<std::uint8_t>, encode<std::int16_t>,
                                         encode<std::uint16_t>, encode<std::int32_t>, encode<std::uint32_t>,
                                         encode<float>,         encode<double>};
  kEncoders[type](value, encoding, to);
}

std::string encode(const std::vector<Element>& elements, Encoding encoding) {
  const std::vector<std::string> names = {"ascii", "binary_little_endian", "binary_big_endian"};
  std::string bytes = "ply\nformat ";
  bytes.append(names[static_cast<std::size_t>(encoding)]).append(" 1.0\ncomment by a test\n");
  for (const Element& element : elements) {
    bytes.append("element ").append(element.name).append(" ").append(std::to_string(element.rows.size())).append("\n");
    for (const Property& p : element.properties) {
      bytes += "property ";
      if (p.count_type >= 0) bytes.append("list ").append(kTypes[static_cast<std::size_t>(p.count_type)]).append(" ");
      bytes.append(kTypes[p.type]).append(" ").append(p.name).append("\n");
    }
  }
  bytes += "end_header\n";
  for (const Element& element : elements) {
    for (const auto& row : element.rows) {
      for (std::size_t p = 0; p < row.size(); ++p) {
        const Property& property = element.properties[p];
        if (property.count_type >= 0)
          encode(static_cast<double>(row[p].size()), static_cast<std::size_t>(property.count_type), encoding, bytes);
        for (const double value : row[p]) encode(value, property.type, encoding, bytes);
      }
      if (encoding == Encoding::ascii) bytes.back() = '\n';
    }
  }
  return bytes;
}

// A number that the type holds.
double number(std::size_t type) {
  static constexpr double kLow[] = {-128, 0, -32768, 0, -2147483648.0, 0};
  static constexpr double kHigh[] = {127, 255, 32767, 65535, 2147483647.0, 4294967295.0};
  if (type >= 6) {
    const double value = static_cast<double>(*rc::gen::arbitrary<std::int32_t>()) / 1024;
    return type == 6 ? static_cast<double>(static_cast<float>(value)) : value;
  }
  return std::clamp(static_cast<double>(*rc::gen::arbitrary<std::int64_t>() % 5000000000), kLow[type], kHigh[type]);
}

Element random_element(const std::string& name, bool with_coordinates) {
  Element element;
  element.name = name;
  const int others = *rc::gen::inRange(with_coordinates ? 0 : 1, 6);
  for (int p = 0; p < others; ++p) {
    const bool list = *rc::gen::inRange(0, 3) == 0;
    element.properties.push_back({std::string("p").append(std::to_string(p)), *rc::gen::inRange<std::size_t>(0, 8),
                                  list ? *rc::gen::inRange(0, 6) : -1});
  }
  if (with_coordinates) {
    for (const char* axis : {"x", "y", "z"}) {
      const auto at = *rc::gen::inRange<std::size_t>(0, element.properties.size() + 1);
      element.properties.insert(element.properties.begin() + static_cast<std::ptrdiff_t>(at),
                                {axis, *rc::gen::inRange<std::size_t>(0, 8), -1});
    }
  }
  const int rows = *rc::gen::inRange(with_coordinates ? 1 : 0, 20);
  for (int r = 0; r < rows; ++r) {
    auto& row = element.rows.emplace_back();
    for (const Property& p : element.properties) {
      auto& cell = row.emplace_back();
      for (int left = p.count_type < 0 ? 1 : *rc::gen::inRange(0, 5); left > 0; --left) cell.push_back(number(p.type));
    }
  }
  return element;
}

std::vector<Element> random_elements() {
  std::vector<Element> elements;
  const int before = *rc::gen::inRange(0, 3), after = *rc::gen::inRange(0, 3);
  for (int e = 0; e < before; ++e) elements.push_back(random_element("before" + std::to_string(e), false));
  elements.push_back(random_element("vertex", true));
  for (int e = 0; e < after; ++e) elements.push_back(random_element("after" + std::to_string(e), false));
  return elements;
}

const Encoding kEncodings[] = {Encoding::ascii, Encoding::binary, Encoding::binary_big_endian};

}  // namespace

RC_GTEST_PROP(FilesPly, RandomSchemasSurviveInEveryEncodingAndFromEachToEach, ()) {
  const std::vector<Element> elements = random_elements();
  for (const Encoding from : kEncodings) {
    const std::string bytes = encode(elements, from);
    const Cloud cloud = parse(bytes);
    for (const Encoding to : kEncodings) RC_ASSERT(image(cloud, Format::ply, to) == encode(elements, to));
  }
}

RC_GTEST_PROP(FilesPly, RandomAttributesAndCoordinatesHaveTheValuesThatWereWritten, ()) {
  const std::vector<Element> elements = random_elements();
  const Element& vertex = *std::find_if(elements.begin(), elements.end(), [](auto& e) { return e.name == "vertex"; });
  const Encoding encoding = *rc::gen::elementOf(std::vector<Encoding>(kEncodings, kEncodings + 3));
  const Cloud cloud = parse(encode(elements, encoding));
  RC_ASSERT(cloud.points.size() == vertex.rows.size());
  std::size_t scalars = 0;
  for (std::size_t p = 0; p < vertex.properties.size(); ++p) {
    const Property& property = vertex.properties[p];
    const std::size_t axis = std::string("xyz").find(property.name);
    if (property.count_type >= 0) continue;
    if (axis == std::string::npos) {
      ++scalars;
      std::string expected;
      for (const auto& row : vertex.rows) encode(row[p][0], property.type, Encoding::binary, expected);
      const Attribute found = attribute(cloud, property.name);
      RC_ASSERT(std::string(reinterpret_cast<const char*>(found.data.data()), found.data.size()) == expected);
      continue;
    }
    for (std::size_t i = 0; i < vertex.rows.size(); ++i) {
      double value = vertex.rows[i][p][0];
      if (encoding == Encoding::ascii) {  // what counts is the word, even for a float
        std::string word;
        encode(value, property.type, encoding, word);
        value = std::stod(word);
      }
      RC_ASSERT((&cloud.points[i].x)[axis] == static_cast<float>(value - cloud.origin[axis]));
    }
  }
  RC_ASSERT(attributes(cloud).size() == scalars);
}

RC_GTEST_PROP(FilesPly, MovedPointsAndAddedAttributesSurviveInRandomSchemas, ()) {
  std::vector<Element> elements = random_elements();
  const auto vertex = std::find_if(elements.begin(), elements.end(), [](auto& e) { return e.name == "vertex"; });
  const Encoding encoding = *rc::gen::elementOf(std::vector<Encoding>(kEncodings + 1, kEncodings + 3));
  Cloud cloud = parse(encode(elements, encoding));
  std::vector<std::int16_t> extra;
  for (std::size_t i = 0; i < cloud.points.size(); ++i) extra.push_back(static_cast<std::int16_t>(i * 7));
  cloud.added = {make_attribute("extra", ScalarType::int16, extra)};
  const std::size_t moved = *rc::gen::inRange<std::size_t>(0, cloud.points.size());
  cloud.points[moved].y = std::nextafter(cloud.points[moved].y, 1e9F) + 3;

  // The same by the oracle: the file's own value plus the displacement.
  for (std::size_t i = 0; i < vertex->rows.size(); ++i) vertex->rows[i].push_back({static_cast<double>(extra[i])});
  vertex->properties.push_back({"extra", 2});
  for (std::size_t p = 0; p < vertex->properties.size(); ++p) {
    const Property& property = vertex->properties[p];
    if (property.name != "y") continue;
    static constexpr double kLow[] = {-128, 0, -32768, 0, -2147483648.0, 0};
    static constexpr double kHigh[] = {127, 255, 32767, 65535, 2147483647.0, 4294967295.0};
    double& value = vertex->rows[moved][p][0];
    const float before = static_cast<float>(value - cloud.origin[1]);
    value += static_cast<double>(cloud.points[moved].y) - static_cast<double>(before);
    if (property.type < 6) value = std::clamp(std::nearbyint(value), kLow[property.type], kHigh[property.type]);
  }
  RC_ASSERT(image(cloud, Format::ply) == encode(elements, encoding));
}

TEST(PlyFiles, WhatIsLeftOfOneThatLosesPointsNamesTheSame) {
  const auto text = [](const std::string& points, const std::string& faces, const std::string& edges,
                       const std::string& rows) {
    return "ply\nformat ascii 1.0\ncomment TextureFile a.png\nobj_info by hand\nelement camera 1\nproperty int id\n"
           "element vertex " +
           points +
           "\nproperty float x\nproperty float y\nproperty float z\nproperty uint64 t\n"
           "property list uchar int views\nelement face " +
           faces +
           "\nproperty list uchar int vertex_indices\n"
           "property list uchar float texcoord\nproperty int texnumber\nelement edge " +
           edges + "\nproperty int vertex1\nproperty int vertex2\nproperty uchar red\nend_header\n7\n" + rows;
  };
  const std::string all = text("5", "3", "2",
                               "0 0 0 9007199254740993 1 8\n1 0 0 2 0\n0 1 0 3 2 8 9\n1 1 0 4 0\n2 2 0 5 0\n"
                               "3 0 1 2 6 0 0 1 0 0 1 0\n4 4 3 2 0 0 5\n3 0 2 3 0 1\n0 1 9\n4 2 8\n");
  const std::string left = text("4", "2", "1",
                                "0 0 0 9007199254740993 1 8\n0 1.5 0 3 2 8 9\n1 1 0 4 0\n2 2 0 5 0\n"
                                "4 3 2 1 0 0 5\n3 0 1 2 0 1\n3 1 8\n");
  for (const Encoding encoding : {Encoding::ascii, Encoding::binary, Encoding::binary_big_endian}) {
    Cloud cloud = parse(image(parse(all), Format::ply, encoding));
    cloud.points[2].y = 1.5F;
    const Cloud less = without_points(cloud, std::vector<std::uint8_t>{0, 1, 0, 0, 0});
    EXPECT_TRUE(losses(less).empty());
    EXPECT_EQ(image(less, Format::ply, Encoding::ascii), left);
    EXPECT_EQ(image(parse(image(less, Format::ply, encoding)), Format::ply, Encoding::ascii), left);
  }
}

TEST(PlyFiles, WhatMayNamePointsInOtherWaysIsWrittenAnew) {
  const std::string head =
                        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
                        "property float z\n",
                    rows = "end_header\n1 2 3\n4 5 6\n7 8 9\n";
  for (const std::string element :
       {"tristrips 1\nproperty list int int vertex_indices\n", "hair 1\nproperty int vertex\n"}) {
    const std::string values = element.find("list") != element.npos ? "3 0 1 2\n" : "2\n";
    const Cloud less =
        without_points(parse(head + "element " + element + rows + values), std::vector<std::uint8_t>{0, 1, 0});
    EXPECT_EQ(image(less, Format::ply),
              head.substr(0, head.find('3')) + "2" + head.substr(head.find('3') + 1) + "end_header\n1 2 3\n7 8 9\n");
    ASSERT_EQ(losses(less).size(), 1U);
    EXPECT_TRUE(losses(less)[0].starts_with("PLY files that are written anew do not keep 1 row of "))
        << losses(less)[0];
  }
}

TEST(PlyFiles, ADamagedFaceIsNamedWhenPointsAreLeftOut) {
  const Cloud cloud = parse(
      "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 1\nproperty list uchar int vertex_indices\nend_header\n1 2 3\n4 5 6\n3 0 1 2\n");
  const std::string said = thrown_by([&] {
                             image(without_points(cloud, std::vector<std::uint8_t>{0, 1}), Format::ply);
                           }).message;
  EXPECT_NE(said.find("'face' names a point that is not there"), std::string::npos) << said;
}

}  // namespace pointfair::test
