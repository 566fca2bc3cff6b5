// SPDX-License-Identifier: Apache-2.0
// LAZ files against LASzip: what it reads from our files, and what we read from its.
#include <cmath>

#include "io/las/fields.hpp"
#include "io/las/layers.hpp"
#include "io/las/laz.hpp"
#include "io/las/store.hpp"
#include "io_files.h"
#include "laz_oracle.h"

// LASzip never frees its list of the sizes of variable chunks, which only the tests let it write.
extern "C" const char* __lsan_default_suppressions();
const char* __lsan_default_suppressions() { return "leak:LASwritePoint::add_chunk_to_table"; }

namespace pointfair::test {
namespace {

namespace las = io::las;

struct Case {
  std::string name;
  LasSpec las;
  LazSpec laz;
};

std::vector<Case> cases() {
  std::vector<Case> all;
  for (LasSpec spec : all_las_specs()) {
    for (const bool wild : {false, true}) {
      spec.wild = wild;
      for (LazSpec laz : {LazSpec{0, 40, false}, LazSpec{0, 0, false}, LazSpec{0, 100, true},
                          LazSpec{spec.format < 6 ? 1U : 4U, 33, false}}) {
        LasSpec las_spec = spec;
        if (laz.streamed) las_spec.extended = false;  // LASzip looks for the table's place at the end of the file
        all.push_back({"LAS 1." + std::to_string(spec.minor) + ", format " + std::to_string(spec.format) +
                           (spec.described ? ", extra bytes" : "") + (wild ? ", wild" : "") + ", chunks of " +
                           std::to_string(laz.chunk_points) + ", version " + std::to_string(laz.version) +
                           (laz.streamed ? ", streamed" : ""),
                       las_spec, laz});
      }
    }
  }
  return all;
}

std::string records_of(const std::string& las) {
  return las.substr(las_points_begin(las), static_cast<std::size_t>(las_count(las)) * las_record_length(las));
}

// The chunks of a file, each as its parts.
std::vector<las::LayeredChunk> layered_chunks(const std::string& laz) {
  const las::Header header = las::parse_header(laz, "test");
  const las::Compression compression = las::read_compression(header, "test");
  std::vector<las::LayeredChunk> result;
  for (const las::Chunk& chunk : las::read_chunk_table(laz, header, compression, "test").chunks)
    result.push_back(las::split_layers(chunk.bytes, header.record_length, compression.layers(), chunk.points).value());
  return result;
}

}  // namespace

TEST(LazFiles, StrengthZeroIsTheSameFile) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const std::string laz = make_laz(make_las(c.las), c.laz);
    const Cloud cloud = parse(laz, "a.laz");
    EXPECT_EQ(cloud.points.size(), c.las.count);
    EXPECT_TRUE(image(cloud, Format::laz) == laz);
  }
}

TEST(LazFiles, CoordinatesAndAttributesAreThoseOfTheUncompressedFile) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const std::string las = make_las(c.las);
    const Cloud plain = parse(las, "a.las"), packed = parse(make_laz(las, c.laz), "a.laz");
    ASSERT_EQ(plain.points.size(), packed.points.size());
    EXPECT_EQ(std::memcmp(plain.points.data(), packed.points.data(), plain.points.size() * sizeof(Point)), 0);
    for (const AttributeInfo& info : attributes(plain))
      EXPECT_EQ(attribute(plain, info.name).data, attribute(packed, info.name).data) << info.name;
  }
}

TEST(LazFiles, AfterAMoveLaszipReadsTheRecordsOfTheUncompressedFile) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const std::string las = make_las(c.las), laz = make_laz(las, c.laz);
    Cloud plain = parse(las, "a.las"), packed = parse(laz, "a.laz");
    move_some(plain);
    move_some(packed);
    const std::string plain_after = image(plain, Format::las), after = image(packed, Format::laz);
    EXPECT_TRUE(laz_records(after) == records_of(plain_after));
    EXPECT_FALSE(laz_records(after) == records_of(las));
    // the header: what changes are the bounds, and the places of what stands behind the points
    std::string wanted = laz.substr(0, las_points_begin(laz));
    wanted.replace(179, 48, plain_after, 179, 48);
    for (const std::size_t at : {227U, 235U})
      if (c.las.minor >= 4) wanted.replace(at, 8, after, at, 8);
    EXPECT_TRUE(after.substr(0, wanted.size()) == wanted);
    if (c.las.minor >= 4 && c.las.extended) {
      const auto begin = las_get<std::uint64_t>(after, 235);
      EXPECT_TRUE(after.substr(begin) == laz.substr(las_get<std::uint64_t>(laz, 235)));
      EXPECT_EQ(las_get<std::uint64_t>(after, 227) - begin,
                las_get<std::uint64_t>(laz, 227) - las_get<std::uint64_t>(laz, 235));
    }
  }
}

// Of chunks of 40 points the first is left out, the second stays, and of the others every fifth point goes.
TEST(LazFiles, WithoutSomePointsLaszipReadsTheOthersAndOtherChunksStay) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const std::string las = make_las(c.las), laz = make_laz(las, c.laz);
    const Cloud plain = parse(las, "a.las"), packed = parse(laz, "a.laz");
    std::vector<std::uint8_t> removed(plain.points.size());
    for (std::size_t i = 0; i < removed.size(); ++i) removed[i] = i < 40 || (i >= 80 && i % 5 == 0) ? 1 : 0;
    const std::string plain_after = image(without_points(plain, removed), Format::las),
                      after = image(without_points(packed, removed), Format::laz);
    EXPECT_TRUE(laz_records(after) == records_of(plain_after));
    EXPECT_LT(las_count(after), las_count(laz));
    EXPECT_TRUE(after.substr(179, 48) == plain_after.substr(179, 48));
    EXPECT_TRUE(after.substr(107, 24) == plain_after.substr(107, 24));
    if (c.las.minor >= 4) {
      EXPECT_TRUE(after.substr(247, 128) == plain_after.substr(247, 128));
    }
    const Cloud read = parse(after, "b.laz");
    for (const AttributeInfo& info : attributes(read))
      EXPECT_EQ(attribute(read, info.name).data, attribute(parse(plain_after, "b.las"), info.name).data) << info.name;
    if (c.laz.chunk_points == 40) {
      const auto chunks_of = [](const std::string& file) {
        const las::Header header = las::parse_header(file, "test");
        return las::read_chunk_table(file, header, las::read_compression(header, "test"), "test").chunks;
      };
      EXPECT_TRUE(chunks_of(after)[0].bytes == chunks_of(laz)[1].bytes);
    }
  }
}

// Of large clouds nothing is held; chunks are decoded again.
void expect_the_same_blocks(const las::PointStore& kept, const las::PointStore& unkept) {
  for (std::size_t block = 0; block < kept.block_count(); ++block) {
    std::vector<las::Grid> a(kept.block_size(block)), b(kept.block_size(block));
    las::Decoded of_kept, of_unkept;  // the second holds what was decoded, for all that is asked of the block
    kept.grid(block, a, of_kept);
    unkept.grid(block, b, of_unkept);
    EXPECT_TRUE(a == b);
    for (const las::ByteRange wanted : {las::ByteRange{14, 15}, las::ByteRange{0, 65535}}) {
      las::Decoded fresh;
      EXPECT_TRUE(kept.records(block, wanted, of_kept) == unkept.records(block, wanted, of_unkept));
      EXPECT_TRUE(kept.records(block, wanted, of_kept) == unkept.records(block, wanted, fresh));
    }
    std::string moved_a, moved_b;
    a[0][2] = b[0][2] += 5;
    EXPECT_EQ(kept.append_moved_chunk(block, a, of_kept, moved_a),
              unkept.append_moved_chunk(block, a, of_unkept, moved_b));
    EXPECT_TRUE(moved_a == moved_b);
  }
}

TEST(LazFiles, PointsThatAreNotHeldAreThoseThatAre) {
  for (const Case& c : cases()) {
    SCOPED_TRACE(c.name);
    const std::string laz = make_laz(make_las(c.las), c.laz);
    const las::Header header = las::parse_header(laz, "test");
    const las::Compression compression = las::read_compression(header, "test");
    const auto store = [&](std::uint64_t most_kept, io::Residence residence = io::Residence::memory) {
      return las::decode_chunks(las::read_chunk_table(laz, header, compression, "test").chunks, header, compression,
                                laz.size(), "test", residence, most_kept);
    };
    const auto kept = store(std::uint64_t{1} << 30);
    for (const io::Residence residence : {io::Residence::memory, io::Residence::file})
      expect_the_same_blocks(*kept, *store(0, residence));
  }
}

TEST(LazFiles, LayersOtherThanXyAndZStayByteForByte) {
  for (const Case& c : cases()) {
    if (c.las.format < 6) continue;
    SCOPED_TRACE(c.name);
    const std::string laz = make_laz(make_las(c.las), c.laz);
    Cloud cloud = parse(laz, "a.laz");
    move_some(cloud);
    const std::string after = image(cloud, Format::laz);
    const auto chunks_before = layered_chunks(laz), chunks_after = layered_chunks(after);
    ASSERT_EQ(chunks_before.size(), chunks_after.size());
    for (std::size_t i = 0; i < chunks_before.size(); ++i) {
      EXPECT_EQ(chunks_before[i].others, chunks_after[i].others);
      EXPECT_EQ(chunks_before[i].sizes.substr(8), chunks_after[i].sizes.substr(8));
      EXPECT_EQ(chunks_before[i].first_point.substr(12), chunks_after[i].first_point.substr(12));
    }
  }
}

TEST(LazFiles, LayersAreCodedAsLaszipCodesThem) {
  for (const Case& c : cases()) {
    if (c.las.format < 6) continue;
    SCOPED_TRACE(c.name);
    const std::string laz = make_laz(make_las(c.las), c.laz);
    const las::Header header = las::parse_header(laz, "test");
    const las::Compression compression = las::read_compression(header, "test");
    for (const las::Chunk& chunk : las::read_chunk_table(laz, header, compression, "test").chunks) {
      const auto layers = las::split_layers(chunk.bytes, header.record_length, compression.layers(), chunk.points);
      ASSERT_TRUE(layers);
      std::vector<las::Grid> grid(chunk.points);
      std::vector<las::Returns> returns(chunk.points);
      ASSERT_TRUE(las::decode_layers(*layers, grid, returns));
      std::string again;
      las::encode_layers(*layers, grid, returns, again);
      EXPECT_TRUE(again == chunk.bytes);
    }
  }
}

TEST(LazFiles, PointsAreCodedAsLaszipCodesThem) {
  for (unsigned format = 0; format <= 10; ++format) {
    for (const bool wild : {false, true}) {
      for (unsigned seed = 1; seed <= 4; ++seed) {
        const unsigned minor = format >= 6 ? 4 : format >= 4 ? 3 : 2;
        LasSpec spec{.minor = minor,
                     .format = format,
                     .count = seed == 4 ? 1U : 4000U,
                     .extended = false,
                     .plain_extra = seed == 3 ? 5U : 0U,
                     .wild = wild,
                     .seed = seed};
        const std::string las = make_las(spec), laz = make_laz(las, {0, io::las::kUsualChunk, false});
        const std::string ours = image(parse(las, "a.las"), Format::laz);
        EXPECT_TRUE(ours.substr(las_points_begin(ours)) == laz.substr(las_points_begin(laz))) << format << wild << seed;
        EXPECT_TRUE(laz_records(ours) == records_of(las)) << format << wild << seed;
      }
    }
  }
}

// A file's points keep the version of their items; one that was compressed so is compressed so again.
TEST(LazFiles, PointsInOtherVersionsAreCodedAsLaszipCodesThem) {
  for (unsigned format = 0; format <= 10; ++format) {
    for (const bool wild : {false, true}) {
      LasSpec spec{.minor = format >= 6 ? 4U : 3U,
                   .format = format,
                   .count = 3000,
                   .extended = false,
                   .plain_extra = 3,
                   .wild = wild};
      const std::string las = make_las(spec), laz = make_laz(las, {format < 6 ? 1U : 4U, 700, false});
      Cloud cloud = parse(laz, "a.laz");
      const std::vector<float> marks(spec.count, 1);
      cloud.added = {make_attribute("mark", ScalarType::float32, marks)};
      const std::string marked = image(cloud, Format::laz);
      Cloud plain = parse(las, "a.las");
      plain.added = cloud.added;
      const std::string marked_las = image(plain, Format::las);
      EXPECT_TRUE(laz_records(marked) == records_of(marked_las)) << format << wild;
      const std::string again = make_laz(marked_las, {format < 6 ? 1U : 4U, 700, false});
      EXPECT_TRUE(marked.substr(las_points_begin(marked)) == again.substr(las_points_begin(again))) << format << wild;
    }
  }
}

TEST(LazFiles, TheSignOfATimeOfZeroIsKept) {
  LasSpec spec{.minor = 4, .format = 6};
  std::string las = make_las(spec);
  const std::size_t begin = las_points_begin(las), length = las_record_length(las);
  for (std::size_t i = 0; i < spec.count; ++i) las_put(las, begin + i * length + 22, i % 2 == 0 ? 0.0 : -0.0);
  EXPECT_TRUE(laz_records(image(parse(las, "a.las"), Format::laz)) == records_of(las));
}

TEST(LazFiles, TheTableOfChunksIsAsLaszipWritesIt) {
  for (const std::uint32_t points : {40U, 0U}) {
    const std::string laz = make_laz(make_las({.count = 5000}), {0, points, false});
    const las::Header header = las::parse_header(laz, "test");
    const las::Compression compression = las::read_compression(header, "test");
    const las::ChunkTable table = las::read_chunk_table(laz, header, compression, "test");
    std::vector<std::size_t> sizes;
    std::vector<std::uint32_t> counts;
    for (const las::Chunk& chunk : table.chunks) {
      sizes.push_back(chunk.bytes.size());
      counts.push_back(chunk.points);
    }
    EXPECT_TRUE(las::chunk_table(compression, sizes, counts) == laz.substr(table.begin));
    EXPECT_EQ(table.end, laz.size());
  }
}

TEST(LazFiles, LasBecomesLazAndBack) {
  for (LasSpec spec : all_las_specs()) {
    SCOPED_TRACE(std::to_string(spec.minor) + " " + std::to_string(spec.format));
    const std::string las = make_las(spec);
    const std::string laz = image(parse(las, "a.las"), Format::laz);
    EXPECT_TRUE(laz_records(laz) == records_of(las));
    EXPECT_TRUE(image(parse(laz, "a.laz"), Format::las) == las);
  }
}

TEST(LazFiles, AddedAttributesAreKeptWithAllOthers) {
  for (const Case& c : cases()) {
    if (c.las.wild || c.laz.streamed) continue;
    SCOPED_TRACE(c.name);
    const std::string las = make_las(c.las);
    Cloud cloud = parse(make_laz(las, c.laz), "a.laz"), plain = parse(las, "a.las");
    move_some(cloud);
    move_some(plain);
    std::vector<float> marks(c.las.count);
    for (std::size_t i = 0; i < marks.size(); ++i) marks[i] = 0.5F * static_cast<float>(i);
    cloud.added = plain.added = {make_attribute("mark", ScalarType::float32, marks)};
    const std::string after = image(cloud, Format::laz);
    EXPECT_TRUE(laz_records(after) == records_of(image(plain, Format::las)));
    EXPECT_EQ(values<float>(parse(after, "a.laz"), "mark"), marks);
  }
}

TEST(LazFiles, APlyFileBecomesLaz) {
  std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 120000\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty double gps_time\nend_header\n";
  for (int i = 0; i < 120000; ++i)
    ply += std::to_string(i % 300) + " " + std::to_string(i / 300) + " " + std::to_string(i % 7) + ".5 1 2 3 " +
           std::to_string(i) + "\n";
  const Cloud cloud = parse(ply);
  const std::string laz = image(cloud, Format::laz), las = image(cloud, Format::las);
  EXPECT_TRUE(laz_records(laz) == records_of(las));
  EXPECT_EQ(values<double>(parse(laz, "a.laz"), "gps_time")[119999], 119999);
}

TEST(LazFiles, ManyThreadsWriteWhatOneWrites) {
  LasSpec spec{.count = 20000};
  for (const unsigned format : {1U, 6U}) {
    spec.format = format;
    spec.minor = 4;
    const std::string laz = make_laz(make_las(spec), {0, 1000, false});
    Cloud cloud = parse(laz, "a.laz");
    move_some(cloud);
    for (Point& p : cloud.points) p.y += 0.75F;
    const Folder folder;
    std::vector<std::string> written;
    for (const unsigned threads : {1U, 7U}) {
      write(folder / "a.laz", cloud, {.overwrite = true, .threads = threads});
      written.push_back(file_bytes(folder / "a.laz"));
    }
    EXPECT_TRUE(written[0] == written[1]);
    EXPECT_TRUE(written[0] == image(cloud, Format::laz));
  }
}

}  // namespace pointfair::test
