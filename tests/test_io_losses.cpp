// SPDX-License-Identifier: Apache-2.0
// Nothing vanishes without a note: from every format that holds a kind of thing to every other one, the thing is there
// afterwards, or a sentence says that it is lost.
#include "loss_things.h"

namespace pointfair::test {
namespace {

constexpr std::pair<Format, const char*> kTargets[] = {
    {Format::ply, "ply"},     {Format::pcd, "pcd"},          {Format::xyz, "xyz"},       {Format::txt, "txt"},
    {Format::csv, "csv"},     {Format::pts, "pts"},          {Format::off, "off"},       {Format::obj, "obj"},
    {Format::las, "las"},     {Format::laz, "laz"},          {Format::e57, "e57"},       {Format::ptx, "ptx"},
    {Format::stl, "stl"},     {Format::npy, "npy"},          {Format::copc, "copc.laz"}, {Format::glb, "glb"},
    {Format::kitti, "kitti"}, {Format::nuscenes, "nuscenes"}};

bool told(const std::vector<std::string>& notes, const std::string& word) {
  for (const std::string& note : notes)
    if (note.find(word) != std::string::npos) return true;
  return false;
}

std::string joined(const std::vector<std::string>& notes) {
  std::string text;
  for (const std::string& note : notes) text += "\n  " + note;
  return text;
}

}  // namespace

TEST(FilesLosses, NothingVanishesWithoutANote) {
  for (const Thing& thing : things()) {
    const Cloud cloud = parse(thing.bytes, thing.name);
    for (const auto& [format, extension] : kTargets) {
      SCOPED_TRACE(thing.name + " to " + extension);
      const bool copied = io::is_copied(cloud, format) && format != Format::glb;  // which is read only
      const bool has_place = format != Format::stl || !cloud.source->faces().ends.empty();
      // LAS becomes COPC with all its records
      const bool is_octree_of_las = format == Format::copc && cloud.source->format() == Format::las;
      const bool stays = copied || (is_octree_of_las && thing.kind == ContentKind::records);
      const io::Keeps keeps = stays ? io::Keeps::kept : !has_place ? io::Keeps::refused : io::keeps(format, thing.kind);
      if (keeps == io::Keeps::refused) {
        EXPECT_EQ(thrown_by([&] { image(cloud, format); }).kind, ErrorKind::usage);
        continue;
      }
      const Cloud there = parse(image(cloud, format), std::string("a.") + extension);
      const std::vector<std::string> notes = losses(cloud, format);
      const bool is_of_colors = thing.kind == ContentKind::fine_colors || thing.kind == ContentKind::some_colors;
      const bool goes_with_all = is_of_colors && told(notes, "no place for the colours");
      EXPECT_TRUE(is_there(thing, there) || told(notes, thing.word) || goes_with_all) << joined(notes);
      // and the table says the truth
      EXPECT_EQ(is_there(thing, there), keeps == io::Keeps::kept) << joined(notes);
      if (copied) {
        EXPECT_TRUE(notes.empty()) << joined(notes);
      }
    }
  }
}

TEST(FilesLosses, EveryKindIsTried) {
  std::vector<ContentKind> tried;
  for (const Thing& thing : things()) tried.push_back(thing.kind);
  for (std::size_t kind = 0; kind < io::kContentKinds; ++kind)
    EXPECT_NE(std::find(tried.begin(), tried.end(), static_cast<ContentKind>(kind)), tried.end()) << kind;
}

TEST(FilesLosses, PointsWithoutAColourAreTold) {
  const Cloud cloud = parse("v 1 2 3\nv 4 5 6 0 0 1\n", "a.obj");
  EXPECT_TRUE(told(losses(cloud, Format::ply), "1 point without a colour become white"));
  EXPECT_EQ(image(cloud, Format::ply, Encoding::ascii)
                .substr(image(cloud, Format::ply, Encoding::ascii).find("end_header\n") + 11),
            "1 2 3 255 255 255\n4 5 6 0 0 255\n");
  EXPECT_TRUE(losses(cloud, Format::csv).empty());
}

TEST(FilesLosses, NotesSayWhatIsSo) {
  Cloud mesh = parse("mtllib a.mtl\nv 1 2 3\nv 4 5 6\nv 7 8 9.5\nusemtl skin\nf 1 2 3\n", "a.obj");
  set_normals(mesh, std::vector<Point>(3, {0, 0, 1}));
  const std::string of_copy = "a copy of an OBJ file keeps its lines and takes no new normals; PLY and PCD take them";
  EXPECT_EQ(losses(mesh), std::vector<std::string>{of_copy});
  EXPECT_EQ(losses(mesh, Format::ply),
            std::vector<std::string>{"PLY files have no place for the material 'skin', the materials of 'a.mtl'"});
  const Cloud textured = parse(lossy::gltf("TEXCOORD_0", packed<float>({0.5F, 9, 0.25F, 9, -7, 9})), "a.glb");
  EXPECT_TRUE(
      told(losses(textured, Format::obj), "the texture coordinates s, t of points are not written to OBJ files"));
  EXPECT_FALSE(told(losses(textured, Format::obj), "no place for the attribute"));
  const Cloud fine = parse(lossy::mesh("property ushort red\nproperty ushort green\nproperty ushort blue\n",
                                       "1 2 3 1000 1 2\n4 5 6 2000 1 2\n7 8 9.5 65000 1 2\n"));
  EXPECT_TRUE(told(losses(fine, Format::stl), "STL files have no place for the colours"));
  EXPECT_FALSE(told(losses(fine, Format::stl), "rounded"));
  EXPECT_TRUE(told(losses(fine, Format::off), "rounded"));
}

TEST(FilesLosses, ThePartsOfAnObjFileGoWhereTheyHaveAPlace) {
  const std::string obj =
      "mtllib a.mtl\nv 1 2 3\nv 4 5 6\nv 7 8 9\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\nusemtl bark\nf 1/1/1 2/2/1 3/3/1\nl "
      "1 2\n";
  Cloud cloud = parse(obj, "a.obj");
  const std::string text = image(cloud, Format::ply, Encoding::ascii);
  EXPECT_NE(text.find("property list uchar float texcoord\n"), std::string::npos);
  EXPECT_NE(text.find("\n3 0 1 2 6 0 0 1 0 1 1\n"), std::string::npos);
  EXPECT_NE(text.find("\n1 2 3 0 0 1\n"), std::string::npos);
  const Cloud back = parse(image(parse(text), Format::obj), "b.obj");
  EXPECT_EQ(image(back, Format::ply, Encoding::ascii), text);
  cloud.points[0].x = 1.5F;  // in its own format all lines stay
  EXPECT_EQ(image(cloud, Format::obj), "mtllib a.mtl\nv 1.5 2 3" + obj.substr(obj.find("\nv 4")));
}

TEST(FilesLosses, NamesThatLasCutsAreTold) {
  Cloud cloud = parse(lossy::las(1), "a.las");
  const std::vector<float> values(3 * cloud.points.size());
  cloud.added = {make_attribute("a_vector_with_a_name_of_31_bytes", ScalarType::float32, values, 3),
                 make_attribute("short", ScalarType::float32, std::vector<float>(cloud.points.size()))};
  for (const Format format : {Format::las, Format::laz, Format::copc}) {
    EXPECT_TRUE(told(losses(cloud, format), "the attributes a_vector_with_a_name_of_31_bytes_0"));
    EXPECT_FALSE(told(losses(cloud, format), "short"));
  }
}

TEST(FilesLosses, DirectionsWithoutADistanceAreTold) {
  const Cloud cloud = parse(lossy::e57({0, 1, 2}), "a.e57");
  EXPECT_TRUE(told(losses(cloud, Format::ply), "the direction of 1 point without a distance"));
  EXPECT_FALSE(told(losses(parse(lossy::e57({0, 2, 2}), "a.e57"), Format::ply), "the direction"));
  EXPECT_TRUE(losses(cloud, Format::e57).empty());
}

TEST(FilesLosses, NormalsOfAnObjFileAreNotRenewed) {
  Cloud cloud = parse("v 1 2 3\nvn 0 0 1\n", "a.obj");
  EXPECT_EQ(thrown_by([&] { check_new_normals(cloud); }).kind, ErrorKind::usage);
  check_new_normals(cloud, Format::ply);
  set_normals(cloud, std::vector<Point>{{1, 0, 0}});
  EXPECT_NE(thrown_by([&] { image(cloud, Format::obj); }).message.find("not renewed"), std::string::npos);
  EXPECT_NE(image(cloud, Format::ply, Encoding::ascii).find("1 2 3 1 0 0\n"), std::string::npos);
}

TEST(FilesLosses, AFileOfTrianglesHasSome) {
  for (const std::string face : {"f 1 2 3\n", "f 1 3\n", ""}) {
    const Cloud cloud = parse("v 1 2 3\nv nan nan nan\nv 7 8 9\n" + face, "a.obj");
    EXPECT_NE(thrown_by([&] { image(cloud, Format::stl); }).message.find("has no faces"), std::string::npos) << face;
  }
}

TEST(FilesLosses, AFileOfTrianglesInAnotherEncodingIsANewOne) {
  const std::string facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1.5 ";
  const std::string end = "\nendloop\nendfacet\n";
  const Cloud cloud = parse("solid a\n" + facet + "0" + end + facet + "nan" + end + "endsolid a\n", "a.stl");
  EXPECT_TRUE(losses(cloud, Format::stl).empty());
  EXPECT_TRUE(losses(cloud, Format::stl, Encoding::ascii).empty());
  EXPECT_TRUE(told(losses(cloud, Format::stl, Encoding::binary), "points without finite coordinates"));
  EXPECT_EQ(parse(image(cloud, Format::stl, Encoding::binary), "a.stl").points.size(), 3U);
}

TEST(FilesLosses, StrictMakesALossAnError) {
  const Folder folder;
  const Cloud cloud = parse("x,y,z,label\n1,2,3,oak\n", "a.csv");
  const WriteOptions options{.strict = true};
  for (const auto& call : {check_write, write})
    expect_error(ErrorKind::file, "b.ply: PLY files have no place for the column of words 'label'",
                 [&] { call(folder / "b.ply", cloud, options); });
  EXPECT_TRUE(folder.names().empty());
  write(folder / "b.csv", cloud, options);
}

TEST(FilesLosses, IntensityBecomesTheOneOfLas) {
  const auto written = [](const std::string& values) {
    const Cloud cloud = parse("x,y,z,Intensity\n1,2,3," + values + "\n4,5,6,1\n", "a.csv");
    const Cloud las = parse(image(cloud, Format::las), "a.las");
    EXPECT_FALSE(attribute_info(las, "intensity_2"));
    return test::values<std::uint16_t>(las, "intensity");
  };
  EXPECT_EQ(written("700"), (std::vector<std::uint16_t>{700, 1}));
  EXPECT_EQ(written("700.75"), (std::vector<std::uint16_t>{701, 1}));
  EXPECT_EQ(written("0.5"), (std::vector<std::uint16_t>{32768, 65535}));
  EXPECT_EQ(written("-4"), (std::vector<std::uint16_t>{0, 65535}));
}

}  // namespace pointfair::test
