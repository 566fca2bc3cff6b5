// SPDX-License-Identifier: Apache-2.0
// LAS files: all that is not a moved coordinate or a bound stays byte for byte.
#include <cmath>

#include "io_files.h"
#include "las_files.h"

namespace pointfair::test {
namespace {

std::string shown(const LasSpec& spec) {
  return "LAS 1." + std::to_string(spec.minor) + ", point format " + std::to_string(spec.format) +
         (spec.described ? ", extra bytes" : "");
}

// What a coordinate must become, from the plainest reading of the rule: its integer plus the rounded displacement.
std::int32_t expected(std::int32_t own, double displacement, double scale) {
  return static_cast<std::int32_t>(own + std::nearbyint(displacement / scale));
}

// Moves two of three points, and returns by how much.
std::vector<std::array<double, 3>> move_points(Cloud& cloud) {
  std::vector<std::array<double, 3>> moves(cloud.points.size());
  for (std::size_t i = 0; i < moves.size(); ++i) {
    if (i % 3 == 0) continue;
    Point& p = cloud.points[i];
    const Point before = p;
    p.x += 0.1F * static_cast<float>(i % 7);
    p.y -= 0.3F * static_cast<float>(i % 5);
    p.z += 0.0004F * static_cast<float>(i % 4);  // of which some are less than half a step
    moves[i] = {double{p.x} - before.x, double{p.y} - before.y, double{p.z} - before.z};
  }
  return moves;
}

// Not 0 for points that are to be left out.
std::vector<std::uint8_t> some_removed(std::size_t count, unsigned seed) {
  std::vector<std::uint8_t> removed(count);
  for (std::size_t i = 0; i < count; ++i) removed[i] = (i * 7 + seed) % 5 == 0 || i + 1 == count ? 1 : 0;
  return removed;
}

}  // namespace

TEST(LasFiles, StrengthZeroIsTheSameFile) {
  for (const LasSpec& spec : all_las_specs()) {
    SCOPED_TRACE(shown(spec));
    const std::string las = make_las(spec);
    const Cloud cloud = parse(las, "a.las");
    EXPECT_EQ(cloud.points.size(), spec.count);
    EXPECT_EQ(image(cloud, Format::las), las);
  }
}

TEST(LasFiles, OnlyCoordinatesOfMovedPointsAndBoundsChange) {
  for (const LasSpec& spec : all_las_specs()) {
    SCOPED_TRACE(shown(spec));
    const std::string before = make_las(spec);
    Cloud cloud = parse(before, "a.las");
    const auto moves = move_points(cloud);
    std::string after = image(cloud, Format::las);
    ASSERT_EQ(after.size(), before.size());
    std::string wanted = before;
    const std::size_t begin = las_points_begin(before), length = las_record_length(before);
    for (std::size_t i = 0; i < moves.size(); ++i) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::size_t at = begin + i * length + 4 * axis;
        las_put(wanted, at, expected(las_get<std::int32_t>(before, at), moves[i][axis], axis == 2 ? 0.001 : 0.01));
      }
    }
    las_summarize(wanted, begin, spec, length);
    EXPECT_TRUE(after == wanted);
    EXPECT_FALSE(after == before);
  }
}

TEST(LasFiles, PointsThatAreLeftOutAreGoneAndAllElseStays) {
  for (const LasSpec& spec : all_las_specs()) {
    SCOPED_TRACE(shown(spec));
    const std::string before = make_las(spec);
    Cloud cloud = parse(before, "a.las");
    move_points(cloud);
    const std::string moved = image(cloud, Format::las);
    const std::size_t begin = las_points_begin(before), length = las_record_length(before);
    const std::vector<std::uint8_t> removed = some_removed(spec.count, spec.seed);
    std::string wanted = moved.substr(0, begin);
    LasSpec left = spec;
    left.count = 0;
    for (std::size_t i = 0; i < spec.count; ++i) {
      if (removed[i]) continue;
      wanted += moved.substr(begin + i * length, length);
      ++left.count;
    }
    const std::size_t gone = (spec.count - left.count) * length;
    wanted += moved.substr(begin + spec.count * length);
    if (las_get<std::uint32_t>(before, 107) != 0) las_put(wanted, 107, left.count);
    if (spec.minor >= 4) {
      las_put<std::uint64_t>(wanted, 247, left.count);
      for (const std::size_t at : {227U, 235U})
        las_put<std::uint64_t>(wanted, at, las_get<std::uint64_t>(before, at) - gone);
    }
    las_summarize(wanted, begin, left, length);
    EXPECT_TRUE(image(without_points(cloud, removed), Format::las) == wanted);
    EXPECT_TRUE(losses(without_points(cloud, removed), Format::las).empty());
  }
}

TEST(LasFiles, PointsThatAreLeftOutTakeTheirNewAttributesAlong) {
  for (const LasSpec& spec : all_las_specs()) {
    SCOPED_TRACE(shown(spec));
    Cloud cloud = parse(make_las(spec), "a.las");
    Attribute kinds = attribute(cloud, "classification"), number;
    number.name = "number_of_point";
    number.type = ScalarType::uint8;
    for (std::size_t i = 0; i < cloud.points.size(); ++i) {
      kinds.data[i] = std::byte(i % 30);
      number.data.push_back(std::byte(i));
    }
    cloud.added = {kinds, number};
    const std::vector<std::uint8_t> removed = some_removed(spec.count, spec.seed);
    const Cloud after = parse(image(without_points(cloud, removed), Format::las), "b.las");
    std::vector<std::byte> kinds_left, numbers_left;
    for (std::size_t i = 0; i < removed.size(); ++i) {
      if (removed[i]) continue;
      kinds_left.push_back(kinds.data[i]);
      numbers_left.push_back(number.data[i]);
    }
    EXPECT_EQ(attribute(after, "classification").data, kinds_left);
    EXPECT_EQ(attribute(after, "number_of_point").data, numbers_left);
  }
}

TEST(LasFiles, WrongBoundsAreRightOnceAPointMoved) {
  LasSpec spec{.count = 60};
  const std::string good = make_las(spec);
  const std::size_t begin = las_points_begin(good), bounds = 179, bytes = 6 * sizeof(double);
  std::string zeros = good, half = good, not_numbers = good;
  for (std::size_t i = 0; i < 6; ++i) {
    las_put(zeros, bounds + 8 * i, 0.0);
    las_put(not_numbers, bounds + 8 * i, std::numeric_limits<double>::quiet_NaN());
  }
  las_put(half, bounds, las_get<double>(half, bounds + 8));  // one side
  for (const std::string& wrong : {zeros, half, not_numbers}) {
    Cloud cloud = parse(wrong, "a.las");
    EXPECT_EQ(image(cloud, Format::las), wrong);  // nothing moved
    cloud.points[30].z += 1;
    const std::string after = image(cloud, Format::las);
    std::string wanted = after;
    las_summarize(wanted, begin, spec, las_record_length(after));
    EXPECT_EQ(after.substr(bounds, bytes), wanted.substr(bounds, bytes));
    EXPECT_EQ(image(cloud, Format::laz).substr(bounds, bytes), wanted.substr(bounds, bytes));
  }
}

TEST(LasFiles, CoordinatesAreIntegersTimesScalePlusOffset) {
  LasSpec spec;
  const std::string las = make_las(spec);
  const Cloud cloud = parse(las, "a.las");
  for (std::size_t i = 0; i < spec.count; ++i) {
    const std::size_t at = las_points_begin(las) + i * las_record_length(las);
    EXPECT_NEAR(cloud.origin[0] + cloud.points[i].x, las_get<std::int32_t>(las, at) * 0.01 + 500000, 1e-4);
    EXPECT_NEAR(cloud.origin[1] + cloud.points[i].y, las_get<std::int32_t>(las, at + 4) * 0.01 + 5400000, 1e-4);
    EXPECT_NEAR(cloud.origin[2] + cloud.points[i].z, las_get<std::int32_t>(las, at + 8) * 0.001 - 12.5, 1e-4);
  }
}

TEST(LasFiles, AttributesHaveTheBitsOfTheSpecification) {
  for (const unsigned format : {3U, 5U, 8U, 10U}) {
    LasSpec spec{.minor = 4, .format = format};
    const std::string las = make_las(spec);
    const Cloud cloud = parse(las, "a.las");
    const bool wide = format >= 6;
    const auto byte = [&](std::size_t i, std::size_t at) {
      return static_cast<unsigned char>(las[las_points_begin(las) + i * las_record_length(las) + at]);
    };
    const auto numbers = values<std::uint8_t>(cloud, "return_number"),
               counts = values<std::uint8_t>(cloud, "number_of_returns");
    const auto classes = values<std::uint8_t>(cloud, "classification"),
               withheld = values<std::uint8_t>(cloud, "withheld");
    const auto edges = values<std::uint8_t>(cloud, "edge_of_flight_line");
    const auto sources = values<std::uint16_t>(cloud, "point_source_id"),
               blue = values<std::uint16_t>(
                   cloud, format == 8 || format == 10 || format == 3 || format == 5 ? "blue" : "intensity");
    const auto times = values<double>(cloud, "gps_time");
    for (std::size_t i = 0; i < spec.count; ++i) {
      EXPECT_EQ(numbers[i], byte(i, 14) & (wide ? 15 : 7));
      EXPECT_EQ(counts[i], wide ? byte(i, 14) >> 4 : byte(i, 14) >> 3 & 7);
      EXPECT_EQ(classes[i], wide ? byte(i, 16) : byte(i, 15) & 31);
      EXPECT_EQ(withheld[i], wide ? byte(i, 15) >> 2 & 1 : byte(i, 15) >> 7);
      EXPECT_EQ(edges[i], byte(i, wide ? 15 : 14) >> 7);
      EXPECT_EQ(sources[i], byte(i, wide ? 20 : 18) | byte(i, wide ? 21 : 19) << 8);
      const std::size_t at = las_points_begin(las) + i * las_record_length(las);
      EXPECT_EQ(times[i], las_get<double>(las, at + (wide ? 22 : 20)));
      EXPECT_EQ(blue[i], las_get<std::uint16_t>(las, at + (wide ? 34 : 32)));
    }
  }
}

TEST(LasFiles, ExtraBytesAreAttributesByTheirDescriptions) {
  LasSpec spec{.described = true, .plain_extra = 3};
  const std::string las = make_las(spec);
  const Cloud cloud = parse(las, "a.las");
  const auto at = [&](std::size_t i, std::size_t offset) {
    return las_points_begin(las) + i * las_record_length(las) + 20 + offset;
  };
  const auto first = values<std::uint8_t>(cloud, "extra 1");
  const auto scaled = values<double>(cloud, "extra 4");
  const auto rest = attribute(cloud, "extra_bytes");
  const auto triple = attribute(cloud, "extra 29");
  EXPECT_EQ(rest.components, 3U);
  EXPECT_EQ(triple.components, 3U);
  EXPECT_EQ(triple.type, ScalarType::float32);
  for (std::size_t i = 0; i < spec.count; ++i) {
    EXPECT_EQ(first[i], static_cast<unsigned char>(las[at(i, 0)]));
    EXPECT_EQ(scaled[i], 0.25 * las_get<std::int16_t>(las, at(i, 4)) + 100);
    EXPECT_EQ(std::memcmp(rest.data.data() + 3 * i, las.data() + at(i, las_described_bytes()), 3), 0);
  }
}

TEST(LasFiles, AddedAttributesBecomeExtraBytes) {
  for (const bool described : {false, true}) {
    LasSpec spec{.minor = 4, .format = 7, .described = described, .plain_extra = 5};
    const std::string las = make_las(spec);
    Cloud cloud = parse(las, "a.las");
    std::vector<float> normals(3 * spec.count);
    for (std::size_t i = 0; i < normals.size(); ++i) normals[i] = static_cast<float>(i);
    cloud.added = {make_attribute("normal", ScalarType::float32, normals, 3)};
    const std::string after = image(cloud, Format::las);
    EXPECT_EQ(las_record_length(after), las_record_length(las) + 12);
    const Cloud again = parse(after, "a.las");
    const auto ny = values<float>(again, "ny");
    for (std::size_t i = 0; i < spec.count; ++i) EXPECT_EQ(ny[i], normals[3 * i + 1]);
    for (const AttributeInfo& info : attributes(parse(las, "a.las")))
      EXPECT_EQ(attribute(again, info.name).data, attribute(cloud, info.name).data) << info.name;
    EXPECT_NE(after.find(std::string(70000, 'x')), std::string::npos);  // the record behind the points
    EXPECT_EQ(after.substr(las_get<std::uint64_t>(after, 235) + 2, 7), "someone");
  }
}

TEST(LasFiles, AValueThatDoesNotFitIntoItsBitsIsRefused) {
  for (const auto& [format, name, most] : {std::tuple(1U, "classification", 31),
                                           {1U, "return_number", 7},
                                           {6U, "return_number", 15},
                                           {6U, "overlap", 1}}) {
    Cloud cloud = parse(make_las({.minor = 4, .format = format}), "a.las");
    std::vector<std::uint8_t> values(cloud.points.size());
    values.back() = static_cast<std::uint8_t>(most);
    cloud.added = {make_attribute(name, ScalarType::uint8, values)};
    EXPECT_EQ(test::values<std::uint8_t>(parse(image(cloud, Format::las), "a.las"), name), values);
    ++values.back();
    cloud.added = {make_attribute(name, ScalarType::uint8, values)};
    for (const Format to : {Format::las, Format::laz, Format::copc}) {
      const Thrown thrown = thrown_by([&] { image(cloud, to); });
      EXPECT_EQ(thrown.kind, ErrorKind::usage);
      EXPECT_NE(thrown.message.find("0 to " + std::to_string(most) + ";"), std::string::npos) << thrown.message;
    }
    image(cloud, Format::ply);
  }
}

TEST(LasFiles, WaveformsBesideTheFileAreCopiedAndItsIndexIsNot) {
  const Folder folder;
  std::string las = make_las({.minor = 3, .format = 4});
  put_file(folder / "plain.las", las);
  las[6] = 4;  // the waveforms are in a file of their own
  put_file(folder / "in.las", las);
  for (const char* name : {"in.wdp", "in.lax", "plain.wdp"}) put_file(folder / name, "anything");
  write(folder / "copy.las", read(folder / "in.las"));
  EXPECT_EQ(file_bytes(folder / "copy.wdp"), "anything");
  write(folder / "other.las", read(folder / "plain.las"));
  EXPECT_EQ(folder.names(), (std::vector<std::string>{"copy.las", "copy.wdp", "in.las", "in.lax", "in.wdp", "other.las",
                                                      "plain.las", "plain.wdp"}));
  const auto notes = losses(read(folder / "in.las"));
  ASSERT_EQ(notes.size(), 1U);
  EXPECT_NE(notes[0].find("in.lax"), std::string::npos);
  EXPECT_EQ(losses(read(folder / "plain.las")), std::vector<std::string>{});
  put_file(folder / "third.wdp", "of another file");
  EXPECT_NE(thrown_by([&] { write(folder / "third.las", read(folder / "in.las")); }).message.find("exists already"),
            std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(folder / "third.las"));
}

TEST(LasErrors, AFullDiskLeavesNeitherTheFileNorItsWaveforms) {
  const Folder folder;
  std::string las = make_las({.minor = 3, .format = 4, .count = 2000});
  las[6] = 4;  // the waveforms are in a file of their own
  put_file(folder / "in.las", las);
  Cloud cloud = read(folder / "in.las");
  move_points(cloud);
  for (const auto& [waveforms, needed] : {std::pair(std::size_t{100}, las.size()), {3 * las.size(), 3 * las.size()}}) {
    put_file(folder / "in.wdp", std::string(waveforms, 'w'));
    const std::size_t room = needed == las.size() ? 50000 : las.size() + 1;
    const Thrown thrown = thrown_with_room_for(room, [&] { write(folder / "out.las", cloud); });
    EXPECT_EQ(thrown.kind, ErrorKind::file);
    EXPECT_NE(thrown.message.find("needs " + std::to_string(needed) + " bytes"), std::string::npos) << thrown.message;
    EXPECT_EQ(folder.names(), (std::vector<std::string>{"in.las", "in.wdp"}));
  }
}

TEST(LasFiles, AFileOfOnePointIsRead) {
  const std::string las = make_las({.count = 1});
  EXPECT_EQ(image(parse(las, "a.las"), Format::las), las);
}

TEST(LasFiles, APlyFileBecomesLasWithinHalfAStep) {
  std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty double x\nproperty double y\nproperty double z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty ushort intensity\n"
      "property float quality\nend_header\n"
      "500000.125 10 -3.5 255 0 1 65535 0.5\n500100.25 20 7 0 128 2 7 -1e9\n500000.5 10.0625 0 1 2 3 0 nan\n";
  const Cloud cloud = parse(ply);
  const Cloud again = parse(image(cloud, Format::las), "a.las");
  ASSERT_EQ(again.points.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(again.origin[0] + again.points[i].x, cloud.origin[0] + cloud.points[i].x, 1e-5);
    EXPECT_NEAR(again.origin[2] + again.points[i].z, cloud.origin[2] + cloud.points[i].z, 1e-5);
  }
  EXPECT_EQ(values<std::uint16_t>(again, "red"), (std::vector<std::uint16_t>{65535, 0, 257}));
  EXPECT_EQ(values<std::uint16_t>(again, "intensity"), (std::vector<std::uint16_t>{65535, 7, 0}));
  EXPECT_EQ(values<std::uint8_t>(again, "return_number"), (std::vector<std::uint8_t>{1, 1, 1}));
  EXPECT_EQ(values<float>(again, "quality")[1], -1e9F);
}

TEST(LasFiles, CoordinatesThatAreNotFiniteAreRefused) {
  const Cloud cloud = parse("1 2 3\nnan 1 1\n", "a.xyz");
  expect_error(ErrorKind::usage, "finite", [&] { image(cloud, Format::las); });
}

TEST(LasFiles, SixteenBitColoursBecomeBytesOfTheirUpperHalf) {
  const std::string las = make_las({.format = 2});
  const Cloud cloud = parse(las, "a.las");
  const auto red = values<std::uint16_t>(cloud, "red");
  const Cloud again = parse(image(cloud, Format::obj), "a.obj");
  const auto shown = values<float>(again, "red");
  for (std::size_t i = 0; i < red.size(); ++i) EXPECT_NEAR(shown[i], red[i] / 65535.0, 0.01);
}

TEST(LasErrors, ABadFileIsRefusedWithOneClearLine) {
  const std::string good = make_las({.minor = 4, .format = 6});
  struct Case {
    std::size_t at;
    std::string bytes, message;
  };
  const auto number = [](auto value) { return packed({value}); };
  const Case cases[] = {
      {25, "\6", "is LAS 1.6"},
      {94, number(std::uint16_t{227}), "its header names 227 bytes"},
      {96, number(std::uint32_t{100}), "its points begin within its header"},
      {96, number(std::uint32_t{900000000}), "the file ends before its points"},
      {104, "\x0b", "has point format 11"},
      {105, number(std::uint16_t{29}), "its header gives a point 29 bytes, point format 6 takes 30"},
      {247, number(std::uint64_t{0}), "has no points"},
      {247, number(std::uint64_t{7000000000}), "header promises 7000000000 points, file ends after"},
      {139, number(0.0), "the scale or offset of y"},
      {171, number(double{NAN}), "the scale or offset of z"},
      {235, number(std::uint64_t{1} << 40), "promises records behind the points, from byte 1099511627776 on"},
      {243, number(std::uint32_t{3}), "promises 3 records behind the points, file ends after 2"},
  };
  for (const Case& bad : cases) {
    std::string file = good;
    file.replace(bad.at, bad.bytes.size(), bad.bytes);
    expect_refused(file, "a.las", bad.message);
  }
}

TEST(LasErrors, EveryTruncatedPrefixIsRefused) {
  const std::string las = make_las({.minor = 4, .format = 7, .count = 5});
  for (std::size_t size = 0; size < las.size(); size += size < 2000 ? 1 : 1000) refusal(las.substr(0, size), "a.las");
}

TEST(LasFiles, AWrongNumberOfRecordsDoesNotHideThePoints) {
  std::string las = make_las(LasSpec{});
  las_put(las, 100, 1069128089U);
  EXPECT_EQ(image(parse(las, "a.las"), Format::las), las);
}

TEST(LasFiles, AWrongNumberOfRecordsIsMendedWhereARecordIsPutIn) {
  LasSpec spec;
  const std::string good = make_las(spec);
  std::string las = good;
  las_put(las, 100, 1069128089U);
  Cloud cloud = parse(las, "a.las");
  cloud.added = {make_attribute<std::uint8_t>("mark", ScalarType::uint8, std::vector<std::uint8_t>(spec.count, 9))};
  const std::string after = image(cloud, Format::las);
  EXPECT_EQ(las_get<std::uint32_t>(after, 100), las_get<std::uint32_t>(good, 100) + 1);
  EXPECT_NE(after.find("padding"), std::string::npos);  // what stood where more records were promised
  EXPECT_EQ(values<std::uint8_t>(parse(after, "a.las"), "mark"), std::vector<std::uint8_t>(spec.count, 9));
}

TEST(LasFiles, RecordsAboutCompressionStayInAFileThatIsNot) {
  for (const char* user : {"laszip encoded", "copc"}) {
    std::string las = make_las({.records = false});
    const std::string record = las_record(user, user[0] == 'c' ? 1 : 22204, std::string(160, 'r'), false);
    las.insert(las_points_begin(las), record);
    las_put(las, 96, static_cast<std::uint32_t>(las_points_begin(las) + record.size()));
    for (const unsigned count : {1U, 0x8A000004U}) {
      las_put(las, 100, count);
      const Cloud cloud = parse(las, "a.las");
      EXPECT_EQ(losses(cloud), std::vector<std::string>{});
      EXPECT_EQ(image(cloud, Format::las), las) << user;
    }
  }
}

}  // namespace pointfair::test
