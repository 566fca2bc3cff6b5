// SPDX-License-Identifier: Apache-2.0
// What files say beside their points; the scale of LAS files.
#include <cmath>

#include "e57_files.h"
#include "io_files.h"
#include "las_files.h"
#include "pointfair/file_info.hpp"
#include "pointfair/pipeline.hpp"

namespace pointfair::test {
namespace {

std::string las_with(const std::vector<std::pair<unsigned, std::string>>& projections) {
  const std::string las = make_las({.records = false});
  std::string records;
  for (const auto& [id, data] : projections) records += las_record("LASF_Projection", id, data, false);
  std::string file = las.substr(0, las_points_begin(las)) + records + las.substr(las_points_begin(las));
  las_put(file, 100, static_cast<std::uint32_t>(projections.size()));
  las_put(file, 96, static_cast<std::uint32_t>(las_points_begin(las) + records.size()));
  return file;
}

std::string row(const FileInfo& info, const std::string& name) {
  for (const FileInfo::Row& r : info.rows)
    if (r.name == name) return r.value;
  return "(none)";
}

FileInfo info_of(const std::string& las) { return file_info(parse(las, "a.las")); }

std::string geo_keys(std::initializer_list<std::pair<int, int>> keys) {
  std::string data = packed<std::uint16_t>({1, 1, 0, static_cast<std::uint16_t>(keys.size())});
  for (const auto& [key, value] : keys)
    data += packed<std::uint16_t>({static_cast<std::uint16_t>(key), 0, 1, static_cast<std::uint16_t>(value)});
  return data;
}

}  // namespace

TEST(FileInfos, ALasFileSaysWhatItIs) {
  const FileInfo info = info_of(make_las({.minor = 4, .format = 7}));
  EXPECT_EQ(row(info, "version"), "LAS 1.4");
  EXPECT_EQ(row(info, "point_format"), "7");
  EXPECT_EQ(row(info, "scale"), "0.01, 0.01, 0.001");
  EXPECT_EQ(row(info, "offset"), "500000, 5400000, -12.5");
  EXPECT_EQ(row(info, "software"), "a generator 3.1");
  EXPECT_EQ(row(info, "coordinate_system"), "Somewhere");
  EXPECT_EQ(info.metres_per_unit, 1);
  EXPECT_EQ(info.step, 0.01);
}

TEST(FileInfos, TheUnitIsThatOfTheProjectionNotOfItsAnglesOrHeights) {
  const std::string utm =
      "COMPD_CS[\"both\",PROJCS[\"ETRS89 / UTM zone 32N\",GEOGCS[\"ETRS89\",DATUM[\"d\",SPHEROID[\"GRS "
      "1980\",6378137,298.25]],"
      "PRIMEM[\"Greenwich\",0],UNIT[\"degree\",0.0174532925199433]],PROJECTION[\"Transverse_Mercator\"],UNIT[\"metre\","
      "1,"
      "AUTHORITY[\"EPSG\",\"9001\"]],AUTHORITY[\"EPSG\",\"25832\"]],VERT_CS[\"heights\",UNIT[\"foot\",0.3048]],"
      "AUTHORITY[\"EPSG\",\"5555\"]]";
  EXPECT_EQ(info_of(las_with({{2112, utm}})).metres_per_unit, 1);
  EXPECT_EQ(row(info_of(las_with({{2112, utm}})), "coordinate_system"), "both, EPSG:5555");
  const std::string feet =
      "PROJCRS[\"NAD83 / Oregon "
      "(ft)\",BASEGEOGCRS[\"NAD83\",DATUM[\"d\",ELLIPSOID[\"GRS\",6378137,298.25,LENGTHUNIT[\"metre\",1]]]],"
      "CONVERSION[\"c\",PARAMETER[\"False "
      "easting\",1,LENGTHUNIT[\"metre\",1]]],CS[Cartesian,2],AXIS[\"x\",east,LENGTHUNIT[\"foot\","
      "0.3048]],ID[\"EPSG\",2994]]";
  EXPECT_EQ(info_of(las_with({{2112, feet}})).metres_per_unit, 0.3048);
  EXPECT_EQ(row(info_of(las_with({{2112, feet}})), "coordinate_system"), "NAD83 / Oregon (ft), EPSG:2994");
  const std::string degrees = "GEOGCS[\"WGS 84\",DATUM[\"d\"],UNIT[\"degree\",0.017],AUTHORITY[\"EPSG\",\"4326\"]]";
  EXPECT_EQ(info_of(las_with({{2112, degrees}})).metres_per_unit, std::nullopt);
  EXPECT_EQ(info_of(las_with({{2112, "PROJCS[\"cut off"}})).metres_per_unit, std::nullopt);
  EXPECT_EQ(info_of(las_with({{2112, "]]]],\"\"[["}})).metres_per_unit, std::nullopt);
}

TEST(FileInfos, HeightsOfAnotherUnitAreTold) {
  const auto other = [](const FileInfo& info) { return info.has_two_units() ? info.metres_per_height : std::nullopt; };
  const auto height = [&](const std::string& text) { return other(info_of(las_with({{2112, text}}))); };
  const std::string plane = "PROJCS[\"UTM\",UNIT[\"metre\",1]]";
  EXPECT_EQ(height("COMPD_CS[\"both\"," + plane + ",VERT_CS[\"h\",UNIT[\"foot\",0.3048]]]"), 0.3048);
  EXPECT_EQ(height("COMPD_CS[\"both\"," + plane + ",VERT_CS[\"h\",UNIT[\"metre\",1]]]"), std::nullopt);
  EXPECT_EQ(height("COMPOUNDCRS[\"both\",PROJCRS[\"UTM\",CS[Cartesian,2],LENGTHUNIT[\"metre\",1]],"
                   "VERTCRS[\"h\",CS[vertical,1],AXIS[\"up\",up,LENGTHUNIT[\"foot\",0.3048]]]]"),
            0.3048);
  const std::string solid =
      "PROJCRS[\"3D\",CS[Cartesian,3],AXIS[\"x\",east,LENGTHUNIT[\"metre\",1]],AXIS[\"y\",north,"
      "LENGTHUNIT[\"metre\",1]],AXIS[\"h\",up,LENGTHUNIT[\"foot\",0.3048]]]";
  EXPECT_EQ(height(solid), 0.3048);
  EXPECT_EQ(info_of(las_with({{2112, solid}})).metres_per_unit, 1);
  EXPECT_EQ(height(plane), std::nullopt);
  EXPECT_EQ(height("COMPD_CS[\"both\",GEOGCS[\"WGS 84\",UNIT[\"degree\",0.017]],VERT_CS[\"h\",UNIT[\"foot\",0.3]]]"),
            std::nullopt);
  const auto of_keys = [&](std::initializer_list<std::pair<int, int>> keys) {
    return other(info_of(las_with({{34735, geo_keys(keys)}})));
  };
  EXPECT_EQ(info_of(las_with({{34735, geo_keys({{3072, 32633}, {4099, 9001}})}})).metres_per_height, 1);
  EXPECT_EQ(of_keys({{3072, 32633}, {4099, 9002}}), 0.3048);
  EXPECT_EQ(of_keys({{3072, 2994}, {3076, 9002}, {4099, 9001}}), 1);
  EXPECT_EQ(of_keys({{3072, 2994}, {3076, 9002}, {4099, 9003}}), std::nullopt);  // feet of two kinds
  EXPECT_EQ(of_keys({{3072, 32633}, {4099, 9001}}), std::nullopt);
  EXPECT_EQ(of_keys({{3072, 32633}}), std::nullopt);
}

TEST(FileInfos, AGeographicSystemIsOneOfDegrees) {
  const auto wkt = [](const std::string& text) { return info_of(las_with({{2112, text}})).is_geographic; };
  const std::string wgs = "GEOGCS[\"WGS 84\",DATUM[\"d\"],UNIT[\"degree\",0.017]]";
  EXPECT_TRUE(wkt(wgs));
  EXPECT_TRUE(wkt("COMPD_CS[\"both\"," + wgs + ",VERT_CS[\"heights\",UNIT[\"metre\",1]]]"));
  EXPECT_TRUE(wkt("GEOGCRS[\"WGS 84\",DATUM[\"d\"],CS[ellipsoidal,3],ANGLEUNIT[\"degree\",0.017]]"));
  EXPECT_TRUE(wkt("GEODCRS[\"WGS 84\",DATUM[\"d\"],CS[ellipsoidal,2],AXIS[\"lat\",north]]"));
  EXPECT_TRUE(wkt("COMPOUNDCRS[\"both\",GEOGCRS[\"WGS 84\",DATUM[\"d\"],CS[ellipsoidal,2]],VERTCRS[\"h\"]]"));
  EXPECT_TRUE(wkt("BOUNDCRS[SOURCECRS[" + wgs + "],TARGETCRS[GEOGCRS[\"WGS 84\"]]]"));
  EXPECT_FALSE(wkt("PROJCS[\"UTM\"," + wgs + ",PROJECTION[\"t\"],UNIT[\"metre\",1]]"));
  EXPECT_FALSE(wkt("COMPD_CS[\"both\",PROJCS[\"UTM\"," + wgs + ",UNIT[\"metre\",1]],VERT_CS[\"heights\"]]"));
  EXPECT_FALSE(wkt("BOUNDCRS[SOURCECRS[PROJCRS[\"UTM\",BASEGEOGCRS[\"d\"]]],TARGETCRS[" + wgs + "]]"));
  EXPECT_FALSE(wkt("GEODCRS[\"WGS 84\",DATUM[\"d\"],CS[Cartesian,3],LENGTHUNIT[\"metre\",1]]"));
  EXPECT_FALSE(wkt("GEOCCS[\"WGS 84\",DATUM[\"d\"],UNIT[\"metre\",1]]"));
  const auto keys = [](std::initializer_list<std::pair<int, int>> its) {
    return info_of(las_with({{34735, geo_keys(its)}})).is_geographic;
  };
  EXPECT_TRUE(keys({{2048, 4326}}));
  EXPECT_TRUE(keys({{1024, 2}, {2048, 4326}}));
  EXPECT_TRUE(keys({{1024, 2}}));
  EXPECT_FALSE(keys({{1024, 1}, {2048, 4326}}));  // a projection that the keys describe and do not name
  EXPECT_FALSE(keys({{1024, 3}, {2048, 4978}}));  // geocentric
  EXPECT_FALSE(keys({{1024, 1}, {2048, 4326}, {3072, 32633}}));
  EXPECT_FALSE(keys({}));
}

TEST(FileInfos, ACloudInDegreesIsNotDenoised) {
  const std::string degrees = "GEOGCS[\"WGS 84\",DATUM[\"d\"],UNIT[\"degree\",0.017]]";
  Pipeline pipeline = loaded(parse(las_with({{2112, degrees}}), "a.las"));
  EXPECT_GT(pipeline.estimates().spacing, 0);
  const Thrown thrown = thrown_by([&] { pipeline.run({}); });
  EXPECT_EQ(thrown.kind, ErrorKind::file);
  EXPECT_NE(thrown.message.find("a.las: "), std::string::npos);
  EXPECT_NE(thrown.message.find("project it"), std::string::npos);
  pipeline.load(parse(las_with({}), "a.las"));
  pipeline.run({});
}

TEST(FileInfos, GeoKeysNameSystemAndUnit) {
  EXPECT_EQ(info_of(las_with({{34735, geo_keys({{3072, 2993}, {3076, 9001}})}})).metres_per_unit, 1);
  EXPECT_EQ(info_of(las_with({{34735, geo_keys({{3072, 2994}, {3076, 9002}})}})).metres_per_unit, 0.3048);
  EXPECT_EQ(info_of(las_with({{34735, geo_keys({{3072, 32633}})}})).metres_per_unit, 1);
  EXPECT_EQ(info_of(las_with({{34735, geo_keys({{3072, 2994}})}})).metres_per_unit, std::nullopt);
  EXPECT_EQ(info_of(las_with({{34735, geo_keys({{2048, 4326}})}})).metres_per_unit, std::nullopt);
  const FileInfo info = info_of(las_with({{34735, geo_keys({{3072, 32633}})}, {34737, "WGS 84 / UTM zone 33N|other"}}));
  EXPECT_EQ(row(info, "coordinate_system"), "WGS 84 / UTM zone 33N, EPSG:32633");
}

TEST(FileInfos, LengthsInMetresFollowTheUnitOfTheLoadedFile) {
  Pipeline pipeline(Device::cpu);
  Params params{.noise = {0.3048, Length::Unit::metre}};
  const auto loaded = [&](const std::string& las) {
    pipeline.load(parse(las, "a.las"));
    return pipeline.resolve(params).noise.value;
  };
  EXPECT_DOUBLE_EQ(loaded(las_with({{34735, geo_keys({{3072, 2994}, {3076, 9002}})}})), 1);  // feet
  EXPECT_DOUBLE_EQ(loaded(las_with({{34735, geo_keys({{3072, 2993}, {3076, 9001}})}})), 0.3048);
  EXPECT_EQ(thrown_by([&] { loaded(las_with({})); }).kind, ErrorKind::usage);
  EXPECT_EQ(thrown_by([&] { pipeline.run(params); }).kind, ErrorKind::usage);
}

TEST(FileInfos, AnE57FileIsInMetres) {
  E57Scan scan;
  for (const char* name : {"cartesianX", "cartesianY", "cartesianZ"})
    scan.fields.push_back({name, "scaled", {1, 2}, 0, 10, 0.005, 0, ""});
  const FileInfo info = file_info(parse(make_e57({scan, scan}), "a.e57"));
  EXPECT_EQ(info.metres_per_unit, 1);
  EXPECT_EQ(info.step, 0.005);
  EXPECT_EQ(row(info, "scans"), "2");
  EXPECT_EQ(row(info, "software"), "made by the tests");
}

TEST(FileInfos, AnE57ScanWithoutPointsNeedsNoCoordinates) {
  E57Scan empty, scan;
  empty.fields = {{"intensity", "integer", {}, 0, 255, 1, 0, ""}};
  for (const char* name : {"cartesianX", "cartesianY", "cartesianZ"})
    scan.fields.push_back({name, "scaled", {1, 2}, 0, 10, 0.005, 0, ""});
  const FileInfo info = file_info(parse(make_e57({empty, scan}), "a.e57"));
  EXPECT_EQ(row(info, "scans"), "2");
  EXPECT_EQ(info.step, 0.005);
}

TEST(FileInfos, OtherFormatsSayNothing) {
  const FileInfo info = file_info(parse("1 2 3\n", "a.xyz"));
  EXPECT_TRUE(info.rows.empty());
  EXPECT_FALSE(info.metres_per_unit);
  EXPECT_EQ(info.step, 0);
}

TEST(LasScale, AFinerGridHoldsSmallMovesAndLeavesOthersWhereTheyAre) {
  for (const Format format : {Format::las, Format::laz}) {
    const std::string las = make_las({.minor = 4, .format = 6});
    Cloud cloud = parse(las, "a.las");
    const float before = cloud.points[3].x;
    cloud.points[3].x += 0.0035F;
    const Folder folder;
    WriteOptions options{.las_scale = 0.001};
    const auto path = folder / (format == Format::las ? "a.las" : "a.laz");
    write(path, cloud, options);
    const Cloud again = read(path);
    EXPECT_EQ(row(file_info(again), "scale"), "0.001, 0.001, 0.001");
    EXPECT_NEAR(again.points[3].x - before, 0.0035, 0.00051);
    for (std::size_t i = 0; i < cloud.points.size(); ++i) {
      if (i == 3) continue;
      EXPECT_EQ(again.points[i].x, cloud.points[i].x);
    }
    const std::string after = file_bytes(path);
    EXPECT_EQ(las_get<double>(after, 179), las_get<double>(las, 179));  // the bounds are where they were
    EXPECT_NEAR(las_get<double>(after, 187), las_get<double>(las, 187), 1e-9);
    if (format == Format::las) {
      EXPECT_EQ(las_get<std::int32_t>(after, las_points_begin(after)),
                10 * las_get<std::int32_t>(las, las_points_begin(las)));
    }
  }
}

TEST(LasScale, MustBeAWholePartThatFits) {
  const Cloud cloud = parse(make_las(LasSpec{}), "a.las");
  const Folder folder;
  const auto refused = [&](double scale, const char* name) {
    WriteOptions options{.las_scale = scale};
    const Thrown thrown = thrown_by([&] { write(folder / name, cloud, options); });
    EXPECT_EQ(thrown.kind, ErrorKind::usage);
    EXPECT_EQ(thrown_by([&] { check_write(folder / name, cloud, options); }).message, thrown.message);
    EXPECT_TRUE(folder.names().empty());
    return thrown.message;
  };
  EXPECT_NE(refused(0.003, "a.las").find("divided by a whole number"), std::string::npos);
  EXPECT_NE(refused(0.02, "a.las").find("divided by a whole number"), std::string::npos);
  EXPECT_NE(refused(-1, "a.las").find("divided by a whole number"), std::string::npos);
  EXPECT_NE(refused(1e-7, "a.las").find("32 bits"), std::string::npos);
  EXPECT_NE(refused(0.001, "a.ply").find("only LAS and LAZ"), std::string::npos);
}

}  // namespace pointfair::test
