// SPDX-License-Identifier: Apache-2.0
// Bad files and bad places: one clear line, nothing lost, nothing half-written.
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "io_files.h"

namespace pointfair::test {
namespace {

namespace fs = std::filesystem;

const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";

std::string ply(const std::string& vertex, const std::string& body, const std::string& format = "ascii") {
  return "ply\nformat " + format + " 1.0\n" + vertex + "end_header\n" + body;
}

std::string pcd(const std::string& points, const std::string& data) {
  return "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH " + points + "\nHEIGHT 1\nPOINTS " +
         points + "\nDATA " + data;
}

const WriteOptions kOverwriting{.overwrite = true};

const std::vector<Bad>& bad_files() {
  static const std::vector<Bad> all = {
      {"a.ply", "", "is empty"},
      {"a.foo", "1 2 3\n", "unknown format"},
      {"a.bin", std::string(32, '\1'), "--in-format kitti or nuscenes"},
      {"a.ply", "1 2 3\n", "does not begin with 'ply'"},
      {"a.ply", "ply\nformat ascii 1.0\nelement vertex 1\n", "no 'end_header'"},
      {"a.ply", "ply\nelement vertex 1\n" + kXyz + "end_header\n1 2 3\n", "no 'format' line"},
      {"a.ply", ply("element vertex 1\n" + kXyz, "", "binary"), "line 2: unknown format"},
      {"a.ply", ply("element vertex many\n" + kXyz, ""), "line 3: expected 'element NAME COUNT'"},
      {"a.ply", ply("element vertex 1\nproperty quaternion x\n", ""), "line 4: expected 'property TYPE NAME'"},
      {"a.ply", ply("property float x\n", ""), "line 3: a property before the first element"},
      {"a.ply", ply("element vertex 1\nproperty list float float l\n" + kXyz, ""), "line 4: expected 'property"},
      {"a.ply", ply("vertex 1\n", ""), "line 3: unexpected 'vertex'"},
      {"a.ply", ply("element face 1\nproperty float x\n", "1\n"), "no element 'vertex'"},
      {"a.ply", ply("element vertex 0\n" + kXyz, ""), "has no points"},
      {"a.ply", ply("element vertex 1\nproperty float x\nproperty float y\n", "1 2\n"), "no property 'z'"},
      {"a.ply", ply("element vertex 1\nproperty list uchar float x\nproperty float y\nproperty float z\n", "1 1 2 3\n"),
       "property 'x' of the points is a list"},
      {"scan.ply", ply("element vertex 1000\n" + kXyz, "1 2 3\n4 5 6\n"),
       "header promises 1000 points, file ends after 2; "},
      {"scan.ply", ply("element vertex 1\n" + kXyz, "1 2 3\n4 5 6\n"), "header promises 1 points, 1 more lines follow"},
      {"a.ply", ply("element vertex 2\n" + kXyz, "1 2 3\n4 5 6 7\n"), "line 9: more values than the header names"},
      {"a.ply", ply("element vertex 2\n" + kXyz, "1 2 3\n4 5\n"), "line 9: too few values: '4 5'"},
      {"a.ply", ply("element vertex 2\n" + kXyz, "1 2 3\n4 5 six\n"), "line 9: 'six' is not a number"},
      {"a.ply", ply("element vertex 3\n" + kXyz, std::string(35, 'a'), "binary_little_endian"),
       "header promises 3 points, file ends after 2"},
      {"a.ply", ply("element vertex 3\n" + kXyz, std::string(40, 'a'), "binary_little_endian"),
       "header promises 3 points, 4 bytes follow the last"},
      {"a.ply", ply("element vertex 1099511627776\n" + kXyz, std::string(24, 'a'), "binary_big_endian"),
       "header promises 1099511627776 points, file ends after 2"},
      {"a.ply", ply("element vertex 1099511627776\n" + kXyz, "1 2 3\n"),
       "header promises 1099511627776 points, file ends after 1"},
      {"a.ply", ply("element vertex 18446744073709551615\n" + kXyz, "1 2 3\n"),
       "header promises 18446744073709551615 points, file ends after 1"},
      {"a.ply", ply("element vertex 18446744073709551616\n" + kXyz, "1 2 3\n"),
       "line 3: expected 'element NAME COUNT'"},
      {"a.ply",
       ply("element vertex 1099511627776\n" + kXyz + "property list uchar int l\n", std::string(13, '\0'),
           "binary_little_endian"),
       "header promises 1099511627776 points, file ends after 1"},
      {"a.ply",
       ply("element vertex 1\n" + kXyz + "element face 9\nproperty list uint int l\n",
           std::string(12, '\0') + "\xff\xff\xff\xff" + std::string(64, '\0'), "binary_little_endian"),
       "header promises 9 rows of 'face', file ends after 0"},
      {"a.pcd", "FIELDS x y z\n", "no 'DATA' line"},
      {"a.pcd", pcd("0", "ascii\n"), "has no points"},
      {"a.pcd", pcd("2", "ascii\n1 2 3\n"), "header promises 2 points, file ends after 1"},
      {"a.pcd", pcd("1", "ascii\n1 2 3\n4 5 6\n"), "header promises 1 points, file holds 2"},
      {"a.pcd", pcd("2", "binary\n" + std::string(23, 'a')), "header promises 2 points, file ends after 1"},
      {"a.pcd", pcd("2", "binary\n" + std::string(25, 'a')), "header promises 2 points, 1 bytes follow the last"},
      {"a.pcd", pcd("1099511627776", "binary\n" + std::string(24, 'a')), "header promises 1099511627776 points"},
      {"a.pcd", pcd("18446744073709551615", "binary\n" + std::string(24, 'a')), "header promises 18446744073709551615"},
      {"a.pcd", pcd("2", "binary_compressed\n"), "the file ends before its data"},
      {"a.pcd", pcd("2", "binary_compressed\n" + packed<std::uint32_t>({9, 24}) + "abc"), "promises 9 bytes"},
      {"a.pcd", pcd("2", "binary_compressed\n" + packed<std::uint32_t>({3, 36}) + "abc"),
       "header promises 2 points, the compressed data holds 3"},
      {"a.pcd", pcd("2", "binary_compressed\n" + packed<std::uint32_t>({3, 24}) + "\1ab"),
       "compressed data is damaged"},
      {"a.pcd", pcd("300000000", "binary_compressed\n" + packed<std::uint32_t>({3, 3600000000U}) + "\1ab"),
       "compressed data is damaged"},
      {"a.pcd", pcd("2", "packed\n"), "line 9: unknown DATA"},
      {"a.pcd", "FIELDS x y\nSIZE 4 4\nTYPE F F\nPOINTS 1\nDATA ascii\n1 2\n", "there is no field 'z'"},
      {"a.pcd", "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 3\nPOINTS 1\nDATA ascii\n1 2 3 4 5\n",
       "the field 'z' is a list"},
      {"a.pcd", "FIELDS x y z h\nSIZE 4 4 4 8\nTYPE F F F F\nCOUNT 1 1 1 999999\nPOINTS 1\nDATA ascii\n1 2 3 4\n",
       "COUNT names more values than the file has"},
      {"a.pcd", "FIELDS x y z\nSIZE 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n", "do not have as many entries"},
      {"a.pcd", "FIELDS x y z\nSIZE 4 4 3\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n", "TYPE and SIZE"},
      {"a.pcd", "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 2\nPOINTS 3\nDATA ascii\n",
       "WIDTH x HEIGHT is 4"},
      {"a.xyz", "\n\n", "has no points"},
      {"a.xyz", "# only remarks\n", "has no points"},
      {"a.xyz", "1 2 3\n4 5 6\n7 8 nine\n", "line 3: 'nine' is not a number"},
      {"a.xyz", "1 2 3\n4 5\n", "line 2: too few values: '4 5'"},
      {"a.xyz", std::string("\0\1\2\3\n1 2 3\n", 11), "line 1: holds bytes that are no text"},
      {"a.csv", "id,east,north\n1,2,3\n", "no column is called 'z', there are 'id', 'east', 'north'"},
      {"a.pts", "3\n1 2 3\n4 5 6\n", "first line promises 3 points, file holds 2"},
      {"a.off", "OFF\n", "the numbers of points and faces"},
      {"a.off", "OFF\n0 0 0\n", "has no points"},
      {"a.off", "OFF\n3 0 0\n0 0 0\n", "header promises 3 points, file ends after 1"},
      {"a.off", "OFF\n1 1 0\n0 0 0\n", "header promises 1 points and 1 faces, file holds 0"},
      {"a.off", "4OFF\n1 0 0\n0 0 0 1\n", "only OFF files in 3 dimensions"},
      {"a.off", "OFF BINARY\n1 0 0\n", "binary OFF is not supported"},
      {"a.obj", "# nothing\nvn 0 0 1\n", "has no points"},
      {"a.obj", "v 0 0\n", "line 1: too few values"},
  };
  return all;
}

}  // namespace

TEST(FilesErrors, ABadFileIsRefusedWithOneClearLine) {
  for (const Bad& bad : bad_files()) expect_refused(bad.bytes, bad.name, bad.message);
}

TEST(FilesErrors, ASmallFileMayNotPromiseMoreThanItHolds) {
  const auto repeat = [](const std::string& text, int times) {
    std::string all;
    for (int i = 0; i < times; ++i) all += text;
    return all;
  };
  EXPECT_EQ(parse("1 2 3" + repeat(" 4", 1021) + "\n", "a.xyz").points.size(), 1U);
  expect_refused("1 2 3" + repeat(" 4", 1022) + "\n", "a.xyz", "1025 columns");
  expect_refused("x,y,z" + repeat(",a", 1022) + "\n1,2,3\n", "a.csv", "1025 columns");
  const std::string names = "x,y,z" + repeat(",a", 500) + "\n";
  EXPECT_EQ(parse(names + repeat("1,2,3\n", 5), "a.csv").points.size(), 5U);  // short rows are no fault
  expect_refused(names + repeat("1,2,3\n", 1000), "a.csv", "shorter");
  std::string properties;
  for (int i = 0; i < 5000; ++i) properties += "property char p" + std::to_string(i) + "\n";
  expect_refused(ply("element vertex 1\n" + kXyz + properties, ""), "a.ply", "5003 properties");
  const std::string rows = "element vertex 1\n" + kXyz + "element rows 400000000000\n";
  expect_refused(ply(rows, std::string(12, '\0'), "binary_little_endian"), "a.ply", "'rows' has no properties");
}

TEST(FilesErrors, ALineNumberIsRightInALargeFile) {
  std::string text;
  for (int i = 1; i <= 200000; ++i) text += i == 123456 || i == 150000 ? "1 oops 3\n" : "1 2 3\n";
  expect_refused(text, "a.xyz", "line 123456: 'oops'");
}

TEST(FilesErrors, BadFacesAreRefusedWhenTheyAreAskedFor) {
  for (const auto& [name, bytes] : std::vector<std::pair<std::string, std::string>>{
           {"a.ply", ply("element vertex 1\n" + kXyz + "element face 1\nproperty list uchar int vertex_index\n",
                         "1 2 3\n3 0 0 1\n")},
           {"a.off", "OFF\n1 1 0\n0 0 0\n3 0 0 1\n"},
           {"a.off", "OFF\n1 1 0\n0 0 0\n3 0 0\n"},
           {"a.obj", "v 0 0 0\nf 1 1 2\n"},
           {"a.obj", "v 0 0 0\nf 1 -2 1\n"},
           {"a.obj", "v 0 0 0\nf 1 x 1\n"},
           {"a.obj", "v 0 0 0\nvt 0 0\nvn 0 0 1\nf 1/1/1 1/1/1 1.5\n"}}) {
    SCOPED_TRACE(bytes);
    const Cloud cloud = parse(bytes, name);
    EXPECT_TRUE(attributes(cloud).empty());
    EXPECT_EQ(image(cloud, *format_of(name)), bytes);
    EXPECT_EQ(thrown_by([&] { triangles(cloud); }).kind, ErrorKind::file);
    EXPECT_EQ(thrown_by([&] { image(cloud, Format::stl); }).kind, ErrorKind::file);
  }
}

// A prefix of a text may be a shorter, valid text; its last number may be cut.
TEST(FilesErrors, EveryTruncatedPrefixIsRefusedOrReadCorrectly) {
  for (const Sample& sample : samples()) {
    const Format format = *format_of(sample.name);
    const Cloud whole = parse(sample.bytes, sample.name);
    for (std::size_t length = 0; length < sample.bytes.size(); ++length) {
      SCOPED_TRACE(sample.name + " cut at " + std::to_string(length));
      try {
        const Cloud cut = parse(sample.bytes.substr(0, length), sample.name, format);
        EXPECT_FALSE(sample.binary);
        ASSERT_LE(cut.points.size(), whole.points.size());
        const std::size_t sure = cut.points.size() - 1;
        EXPECT_EQ(std::memcmp(cut.points.data(), whole.points.data(), sure * sizeof(Point)), 0);
        EXPECT_EQ(image(cut, format), sample.bytes.substr(0, length));
      } catch (const Error& error) {
        EXPECT_EQ(error.kind(), ErrorKind::file) << error.what();
      }
    }
  }
}

TEST(FilesErrors, PlacesThatCannotBeReadAreNamed) {
  const Folder folder;
  put_file(folder / "empty.ply", "");
  put_file(folder / "cloud.xyz", "1 2 3\n");
  const auto message = [&](const std::string& name) {
    const Thrown thrown = thrown_by([&] { read(folder / name); });
    EXPECT_EQ(thrown.kind, ErrorKind::file);
    EXPECT_EQ(thrown.message.find((folder / name).string() + ": "), 0U) << thrown.message;
    return thrown.message;
  };
  EXPECT_NE(message("nothing.ply").find("cannot open: No such file"), std::string::npos);
  EXPECT_NE(message("").find("is a directory"), std::string::npos);
  EXPECT_NE(message("empty.ply").find("is empty"), std::string::npos);
  EXPECT_NE(message("cloud.xyz/inside.ply").find("cannot open: Not a directory"), std::string::npos);
  if (::geteuid() == 0) return;  // to root nothing is forbidden
  ::chmod((folder / "cloud.xyz").c_str(), 0);
  EXPECT_NE(message("cloud.xyz").find("Permission denied"), std::string::npos);
}

TEST(FilesErrors, AFailedWriteLeavesNothingAndKeepsTheOldFile) {
  const Folder folder;
  put_file(folder / "in.xyz", "1 2 3\n4 5 6\n");
  put_file(folder / "old.xyz", "9 9 9\n");
  const Cloud cloud = read(folder / "in.xyz");
  const auto expect = [&](const fs::path& path, WriteOptions options, ErrorKind kind, const std::string& part) {
    expect_error(kind, part, [&] { write(path, cloud, options); });
  };
  expect(folder / "old.xyz", {}, ErrorKind::file, "exists already");
  expect(folder / "", {}, ErrorKind::file, "is a directory");
  fs::create_directory(folder / "sub.ply");
  expect(folder / "sub.ply", kOverwriting, ErrorKind::file, "is a directory");
  expect(folder / "out.foo", {}, ErrorKind::file, "unknown extension");
  expect(folder / "no_folder/out.ply", {}, ErrorKind::file, "cannot create a file in its folder");
  expect(folder / "in.xyz/out.ply", {}, ErrorKind::file, "Not a directory");
  expect(folder / "out.xyz", {.encoding = Encoding::binary}, ErrorKind::usage, "no such encoding");
  EXPECT_EQ(folder.names(), (std::vector<std::string>{"in.xyz", "old.xyz", "sub.ply"}));
  EXPECT_EQ(file_bytes(folder / "old.xyz"), "9 9 9\n");
}

TEST(FilesErrors, AFullDiskIsNamedAndTheOldFileStays) {
  const Folder folder;
  std::string text;
  for (int i = 0; i < 20000; ++i) text += std::to_string(i) + " 2 3\n";
  put_file(folder / "in.xyz", text);
  Cloud cloud = read(folder / "in.xyz");
  for (Point& p : cloud.points) p.z += 1;

  const Thrown thrown = thrown_with_room_for(100000, [&] { write(folder / "in.xyz", cloud, kOverwriting); });
  EXPECT_EQ(thrown.kind, ErrorKind::file);
  EXPECT_EQ(thrown.message.find((folder / "in.xyz").string() + ": cannot write: "), 0U) << thrown.message;
  const std::string needed = std::to_string(image(cloud, Format::xyz).size());
  EXPECT_NE(thrown.message.find("needs " + needed + " bytes, "), std::string::npos) << thrown.message;
  EXPECT_NE(thrown.message.find(" more than there is room for: free some space"), std::string::npos) << thrown.message;
  EXPECT_EQ(folder.names(), std::vector<std::string>{"in.xyz"});
  EXPECT_EQ(file_bytes(folder / "in.xyz"), text);
}

TEST(FilesErrors, CheckWriteRefusesWhatWriteWouldAndWritesNothing) {
  const Folder folder;
  put_file(folder / "in.xyz", "1 2 3\nnan 5 6\n");
  const Cloud cloud = read(folder / "in.xyz");
  const auto expect = [&](const fs::path& path, const WriteOptions& options, ErrorKind kind, const std::string& part) {
    for (const auto& call : {check_write, write}) expect_error(kind, part, [&] { call(path, cloud, options); });
  };
  const WriteOptions binary{.encoding = Encoding::binary}, scale{.las_scale = 0.001};
  expect(folder / "out.xyz", binary, ErrorKind::usage, "no such encoding; it has ascii");
  expect(folder / "out.laz", binary, ErrorKind::usage, "no such encoding; it has binary-compressed");
  expect(folder / "out.ply", scale, ErrorKind::usage, "only LAS and LAZ files have a scale");
  expect(folder / "out.las", scale, ErrorKind::usage, "finite coordinates only");
  expect(folder / "out.copc.laz", {}, ErrorKind::usage, "finite coordinates only");
  expect(folder / "out.stl", {}, ErrorKind::usage, "this cloud has no faces");
  expect(folder / "out.glb", {}, ErrorKind::usage, "glTF files are read, not written");
  expect(folder / "out.kitti", {}, ErrorKind::usage, "written from such files only");
  expect(folder / "out.foo", {}, ErrorKind::file, "unknown extension");
  const Thrown unknown = thrown_by([&] { check_write(folder / "out.foo", cloud, {}); });
  EXPECT_EQ(unknown.message.find(".glb"), std::string::npos) << "offered, and then refused: " << unknown.message;
  check_write(folder / "out.ply", cloud, binary);
  EXPECT_EQ(folder.names(), std::vector<std::string>{"in.xyz"});
}

TEST(FilesErrors, AFullDeviceIsNamed) {
  if (::access("/dev/full", W_OK) != 0) GTEST_SKIP() << "no /dev/full here";
  const Cloud cloud = parse("1 2 3\n", "a.xyz");
  expect_error(ErrorKind::file, "/dev/full: cannot write: No space left on device",
               [&] { write("/dev/full", cloud, {.format = Format::xyz}); });
  EXPECT_TRUE(fs::is_character_file("/dev/full"));
}

TEST(FilesErrors, TheInputMayBeOverwrittenWhileItIsRead) {
  const Folder folder;
  put_file(folder / "a.xyz", "1 2 3\n4 5 6\n");
  ::chmod((folder / "a.xyz").c_str(), 0640);
  Cloud cloud = read(folder / "a.xyz");
  cloud.points[0].x = 7;
  const WriteOptions over{.overwrite = true, .sync = true, .threads = 1};
  write(folder / "a.xyz", cloud, over);
  EXPECT_EQ(file_bytes(folder / "a.xyz"), "7 2 3\n4 5 6\n");
  EXPECT_EQ(fs::status(folder / "a.xyz").permissions(), fs::perms(0640));
  cloud.points[1].x = 8;  // the mapping still shows the first file
  write(folder / "a.xyz", cloud, over);
  EXPECT_EQ(file_bytes(folder / "a.xyz"), "7 2 3\n8 5 6\n");
  EXPECT_EQ(folder.names(), std::vector<std::string>{"a.xyz"});
}

TEST(FilesErrors, ASymbolicLinkStaysOne) {
  const Folder folder;
  put_file(folder / "real.xyz", "1 2 3\n");
  fs::create_symlink("real.xyz", folder / "link.xyz");
  const Cloud cloud = parse("4 5 6\n", "a.xyz");
  write(folder / "link.xyz", cloud, kOverwriting);
  EXPECT_TRUE(fs::is_symlink(folder / "link.xyz"));
  EXPECT_EQ(file_bytes(folder / "real.xyz"), "4 5 6\n");
}

// A child is interrupted while its output is half written; its handler does what a program's should.
TEST(FilesErrors, AnInterruptedWriteLeavesNoFile) {
  const Folder folder;
  const fs::path fifo_ready = folder / "ready";
  ASSERT_EQ(::mkfifo(fifo_ready.c_str(), 0600), 0);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    std::signal(SIGTERM, [](int) {
      remove_unfinished_files();
      ::_exit(17);
    });
    Cloud cloud;
    cloud.points.assign(200000, {1.5F, 2.5F, 3.5F});
    const int ready = ::open(fifo_ready.c_str(), O_WRONLY);
    if (::write(ready, "x", 1) != 1) ::_exit(1);
    const WriteOptions options{.overwrite = true, .threads = 1};  // a child has no worker threads
    for (int i = 0;; ++i) write(folder / ("out" + std::to_string(i % 3) + ".xyz"), cloud, options);
  }
  const int ready = ::open(fifo_ready.c_str(), O_RDONLY);
  char byte = 0;
  EXPECT_EQ(::read(ready, &byte, 1), 1);
  ::close(ready);
  ::usleep(200000);
  ::kill(child, SIGTERM);
  int status = 0;
  ::waitpid(child, &status, 0);
  EXPECT_EQ(WEXITSTATUS(status), 17);
  for (const std::string& name : folder.names()) {
    if (name == "ready") continue;
    EXPECT_EQ(name.find("out"), 0U) << "left behind";
    EXPECT_EQ(read(folder / name).points.size(), 200000U) << "half a file";
  }
}

}  // namespace pointfair::test
