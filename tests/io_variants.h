// SPDX-License-Identifier: Apache-2.0
// Two variants or more of each file that once went wrong, as other programs and people would write it.
#pragma once

#include <limits>

#include "io_cases.h"

namespace pointfair::test {
namespace variants {

inline std::string binary_ply(const std::string& properties, const std::string& body, bool big_endian = false,
                              const std::string& after = "") {
  return std::string("ply\r\nformat binary_") + (big_endian ? "big" : "little") +
         "_endian 1.0\r\nelement vertex 2\r\n" + replaced(kXyz + properties + after, "\n", "\r\n") + "end_header\r\n" +
         body;
}

inline std::string pcd(const std::string& fields, const std::string& sizes, const std::string& types,
                       const std::string& body, const std::string& data = "ascii") {
  return "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS " + fields + "\nSIZE " + sizes + "\nTYPE " +
         types + "\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA " + data + "\n" + body;
}

inline const std::string kPlain = "x,y,z\n1,2,3\n4,5,6\n";
inline const std::string kRgb = "x,y,z,red,green,blue\n1,2,3,10,20,30\n4,5,6,40,50,255\n";
inline const std::string kWide = "x,y,z,t\n1,2,3,1234567890123456789\n4,5,6,1234567890123456790\n";

// Byte order marks and ends of lines.
inline const std::vector<Given>& bytes() {
  const std::string lines = "1 2 3\r4 5 6\r";
  static const std::vector<Given> all = {
      {"bom.obj", kMark + "# by an editor\r\nv 1 2 3\r\nv 4 5 6\r\n", kPlain},
      {"bom.obj", kMark + "v 1 2 3\rv 4 5 6\rl 1 2\r", kPlain},
      {"bom.ply", kMark + replaced(ply(kXyz, "1 2 3\n4 5 6\n"), "\n", "\r\n"), kPlain},
      {"bom.ply", kMark + binary_ply("", packed<float>({1, 2, 3, 4, 5, 6})), kPlain},
      {"crlf_bom.off", kMark + "COFF\r\n2 0 0\r\n1 2 3 10 20 30 255\r\n4 5 6 40 50 255 255\r\n",
       "x,y,z,red,green,blue,alpha\n1,2,3,10,20,30,255\n4,5,6,40,50,255,255\n"},
      {"crlf_bom.off", kMark + "2 1 0\r\n1 2 3\r\n4 5 6\r\n3 0 1 0\r\n", kPlain},
      {"mac_cr300.xyz", "# by an old program\r" + lines, kPlain},
      {"mac_cr300.txt", "x\ty\tz\r1\t2\t3\r4\t5\t6", kPlain},
      {"mac_cr300.obj", "# triangles\rv 1 2 3\rv 4 5 6\rvn 0 0 1\rf 1//1 2//1 1//1",
       "x,y,z,nx,ny,nz\n1,2,3,0,0,1\n4,5,6,0,0,1\n"},
      {"mac_cr300.obj", "v 1 2 \\\r3\rv 4 5 6\r", kPlain},
      {"mac_cr.ply", with_cr(ply(kXyz + "property uchar i\n", "1 2 3 7\n4 5 6 8\n")), "x,y,z,i\n1,2,3,7\n4,5,6,8\n"},
      {"mac_cr.ply",
       with_cr(ply(kXyz + "element face 1\nproperty list uchar int vertex_indices\n", "1 2 3\n4 5 6\n3 0 1 0\n")),
       kPlain},
      {"nul_tail.csv", "x,y,z\r\n1,2,3\r\n4,5,6\r\n" + std::string(4096, '\0'), kPlain},
      {"nul_tail.pts", "2\n1 2 3\n4 5 6\n" + std::string(3, '\0'), kPlain},
  };
  return all;
}

// Colours and normals.
inline const std::vector<Given>& colors() {
  const std::string normals = "x,y,z,nx,ny,nz\n1,2,3,0.6,0,-0.8\n4,5,6,0,1,0\n";
  static const std::vector<Given> all = {
      {"color255.obj", "v 1 2 3 10.0 20.0 30.0\nv 4 5 6 40.0 50.0 255.0\n", kRgb},
      {"color255.obj", "v 1 2 3 1 1 1\nv 4 5 6 0 2 0\n", "x,y,z,red,green,blue\n1,2,3,1,1,1\n4,5,6,0,2,0\n"},
      {"float_colors_255.ply",
       binary_ply("property double red\nproperty double green\nproperty double blue\n",
                  packed<float>({1, 2, 3}) + packed<double>({10, 20, 30}) + packed<float>({4, 5, 6}) +
                      packed<double>({40, 50, 255})),
       kRgb},
      {"float_colors_255.ply",
       ply(kXyz + "property float red\nproperty float green\nproperty float blue\n", "1 2 3 0.2 0 1\n4 5 6 0.4 1 0\n"),
       "x,y,z,red,green,blue\n1,2,3,51,0,255\n4,5,6,102,255,0\n"},
      {"cloudcompare_rf_gf_bf.txt", "//X Y Z Rf Gf Bf\n1 2 3 0.2 0 1\n4 5 6 0.4 1 0\n",
       "x,y,z,red,green,blue\n1,2,3,51,0,255\n4,5,6,102,255,0\n"},
      {"cloudcompare_rf_gf_bf.csv", "X;Y;Z;Rf;Gf;Bf;Nx;Ny;Nz\n1;2;3;0.2;0;1;0.6;0;-0.8\n4;5;6;0.4;1;0;0;1;0\n",
       "x,y,z,red,green,blue,nx,ny,nz\n1,2,3,51,0,255,0.6,0,-0.8\n4,5,6,102,255,0,0,1,0\n"},
      {"some_colors.obj", "v 1 2 3 1 0 0.2\nv 4 5 6\n", "x,y,z,red,green,blue\n1,2,3,1,0,0.2\n4,5,6,nan,nan,nan\n",
       "1 point without a colour become white"},
      {"some_colors.obj", "v 1 2 3\nv 7 8 9\nv 4 5 6 10 20 255\n",
       "x,y,z,red,green,blue\n1,2,3,nan,nan,nan\n7,8,9,nan,nan,nan\n4,5,6,10,20,255\n",
       "2 points without a colour become white"},
      {"off_rgb_plain.off", "OFF 2 1 0\n1 2 3 0.2 0 1\n4 5 6 0.4 1 0\n3 0 1 0\n",
       "x,y,z,red,green,blue\n1,2,3,51,0,255\n4,5,6,102,255,0\n"},
      {"off_rgb_plain.off", "OFF\r\n2 1 0\r\n\r\n1 2 3 10 20 30\r\n4 5 6 40 50 255\r\n2 0 1 9 9 9\r\n", kRgb,
       "colours of faces"},
      {"vn.obj", "v 1 2 3\nv 4 5 6\nvn 0.6 0 -0.8\nvn 0 1 0\nf 1//1 2//2 1//1\n", normals},
      {"vn.obj", "v 1 2 3\nv 4 5 6\nvt 0 0\nvn 0.6 0 -0.8\nvn 0 1 0\nf 1/1/1 2/1/2 1/1/1\nf 1/1/2 2/1/2 2/1/2\n",
       kPlain, "normals of corners"},
      {"normals_ext.xyzn", "# x y z and a normal\n1\t2\t3\t0.6\t0\t-0.8\n4\t5\t6\t0\t1\t0\n", normals},
      {"NORMALS_EXT.XYZN", "1,2,3,0.6,0,-0.8\n4,5,6,0,1,0\n", normals},
      {"colors_ext.xyzrgb", "1 2 3 10 20 30\n4 5 6 40 50 255\n", kRgb},
      {"colors_ext.xyzrgb", "1;2;3;0.2;0;1\n4;5;6;0.4;1;0\n",
       "x,y,z,red,green,blue\n1,2,3,51,0,255\n4,5,6,102,255,0\n"},
  };
  return all;
}

// What a format has no place for is told.
inline const std::vector<Given>& parts() {
  static const std::vector<Given> all = {
      {"viewlist.ply",
       ply(kXyz + "property list uchar float weights\nproperty uchar i\n", "1 2 3 0 7\n4 5 6 2 .5 1 8\n"),
       "x,y,z,i\n1,2,3,7\n4,5,6,8\n", "weights", Format::csv},
      {"viewlist.ply",
       binary_ply("property list uint ushort view\n", packed<float>({1, 2, 3}) + packed<std::uint32_t>({1}) +
                                                          packed<std::uint16_t>({9}) + packed<float>({4, 5, 6}) +
                                                          packed<std::uint32_t>({0})),
       kPlain, "view", Format::pcd},
      {"tristrips.ply",
       binary_ply("", packed<float>({1, 2, 3, 4, 5, 6}) + packed<std::int32_t>({3, 0, 1, 0}), false,
                  "element tristrips 1\nproperty list int int vertex_indices\n"),
       kPlain, "tristrips", Format::off},
      {"tristrips.ply",
       ply(kXyz + "element edge 1\nproperty int vertex1\nproperty int vertex2\nelement camera 1\nproperty float f\n",
           "1 2 3\n4 5 6\n0 1\n35\n"),
       kPlain, "camera", Format::obj},
      {"text_col.csv", "label;x;y;z\noak, old;1;2;3\n\"ash; young\";4;5;6\n", kPlain, "label"},
      {"text_col.txt", "x y z species state\n1 2 3 oak dry\n4 5 6 ash green\n", kPlain, "state", Format::pcd},
  };
  return all;
}

// Integers of 64 bits, names, and the sign of zero.
inline const std::vector<Given>& numbers() {
  const std::string ids = "x,y,z,id\n1,2,3,-9223372036854775808\n4,5,6,9223372036854775807\n";
  static const std::vector<Given> all = {
      {"bigints.csv", "x;y;z;t\n1;2;3;1234567890123456789\n4;5;6;1234567890123456790\n", kWide, "t has more digits"},
      {"bigints.txt", "x y z t\n1 2 3 1234567890123456789\n4 5 6 1234567890123456790\n", kWide, "t has more digits",
       Format::e57},
      {"uint64_times.pcd",
       pcd("x y z t", "4 4 4 8", "F F F U", "1 2 3 1234567890123456789\n4 5 6 1234567890123456790\n"), kWide,
       "t has more digits"},
      {"uint64_times.pcd",
       pcd("t x y z", "8 4 4 4", "I F F F",
           packed<std::int64_t>({1234567890123456789}) + packed<float>({1, 2, 3}) +
               packed<std::int64_t>({1234567890123456790}) + packed<float>({4, 5, 6}),
           "binary"),
       kWide, "t has more digits", Format::e57},
      {"int64.ply", ply("property int64 id\n" + kXyz, "-9223372036854775808 1 2 3\n9223372036854775807 4 5 6\n"), ids,
       "id has more digits", Format::e57},
      {"int64.ply",
       binary_ply(
           "property int64 id\n",
           packed<float>({1, 2, 3}, true) + packed<std::int64_t>({std::numeric_limits<std::int64_t>::min()}, true) +
               packed<float>({4, 5, 6}, true) + packed<std::int64_t>({std::numeric_limits<std::int64_t>::max()}, true),
           true),
       ids},
      {"bool.ply",
       binary_ply("property bool keep\nproperty uchar i\n",
                  packed<float>({1, 2, 3}) + "\1\7" + packed<float>({4, 5, 6}) + std::string("\0\x08", 2)),
       "x,y,z,keep,i\n1,2,3,1,7\n4,5,6,0,8\n"},
      {"bool.ply", ply("property bool keep\n" + kXyz, "0 1 2 3\n1 4 5 6\n"), "x,y,z,keep\n1,2,3,0\n4,5,6,1\n"},
      {"dup_names.csv", "i,x,i,y,i,z\n7,1,8,2,9,3\n7,4,8,5,9,6\n", "x,y,z,i,i_2,i_3\n1,2,3,7,8,9\n4,5,6,7,8,9\n"},
      {"dup_names.ply", ply(kXyz + "property uchar i\nproperty uchar i\n", "1 2 3 7 8\n4 5 6 9 9\n"),
       "x,y,z,i,i_2\n1,2,3,7,8\n4,5,6,9,9\n"},
      {"negzero.csv", "x,y,z,c\n-0.000,2,3,1\n4,-0,6,1\n", "x,y,z,c\n-0,2,3,1\n4,-0,6,1\n"},
      {"negzero.obj", "v -0.0 2 3\nv 4 5 -0e0\n", "x,y,z\n-0,2,3\n4,5,-0\n"},
  };
  return all;
}

// Tokens on other lines, other cases, lines that go on.
inline const std::vector<Given>& tokens() {
  const std::string off = "1 2 3\n4 5 6\n2 0 1\n";
  static const std::vector<Given> all = {
      {"modelnet.off", "OFF2 1 0\r\n" + replaced(off, "\n", "\r\n"), kPlain},
      {"modelnet.off", "COFF2 0 0\n1 2 3 10 20 30 255\n4 5 6 40 50 255 255\n",
       "x,y,z,red,green,blue,alpha\n1,2,3,10,20,30,255\n4,5,6,40,50,255,255\n"},
      {"wrapped.off", "OFF 2\n1 0 1\n2 3 4\n5 6 2\n0 1\n", kPlain},
      {"wrapped.off", "# tokens\nOFF\n\n2\n1\n0\n1\n2\n3\n\n4\n5\n6\n2\n0\n1\n", kPlain},
      {"two_per_line.off", "OFF\n2 1 0\n1 2 3\t4 5 6\n2 0 1\n", kPlain},
      {"two_per_line.off", "OFF\n4 0 0\n1 2 3  4 5 6  7 8 9  1 1 1", "x,y,z\n1,2,3\n4,5,6\n7,8,9\n1,1,1\n"},
      {"nokey.off", "# without a keyword\n2 1 1\n" + off, kPlain},
      {"nokey.off", "2 1\n" + off, kPlain},
      {"lower.off", "coff\n2 0 0\n1 2 3 10 20 30 255\n4 5 6 40 50 255 255\n",
       "x,y,z,red,green,blue,alpha\n1,2,3,10,20,30,255\n4,5,6,40,50,255,255\n"},
      {"lower.off", "Off 2 1 0\n" + off, kPlain},
      {"upper_xyz.ply",
       ply("property double X\nproperty double Y\nproperty double Z\nproperty uchar RED\n", "1 2 3 9\n4 5 6 9\n"),
       "x,y,z,red\n1,2,3,9\n4,5,6,9\n"},
      {"upper_xyz.ply",
       replaced(replaced(replaced(binary_ply("", packed<float>({1, 2, 3, 4, 5, 6})), " x", " X"), " y", " Y"), " z",
                " Z"),
       kPlain},
      {"upperfields.pcd", pcd("X Y Z I", "4 4 4 1", "F F F U", "1 2 3 7\n4 5 6 8\n"), "x,y,z,I\n1,2,3,7\n4,5,6,8\n"},
      {"upperfields.pcd", pcd("X Y Z", "8 8 8", "F F F", packed<double>({1, 2, 3, 4, 5, 6}), "binary"), kPlain},
      {"contin.obj", "v \\\n1 \\\n2 \\\n3\nv 4 5 6\n", kPlain},
      {"contin.obj", "v 1 2 3 \\\r\n0.2 0 1\r\nv 4 5 6 0.4 1 \\\r\n0\r\n",
       "x,y,z,red,green,blue\n1,2,3,51,0,255\n4,5,6,102,255,0\n"},
      {"wrapped_rows.ply", ply(kXyz + "property uchar i\n", "1\n2\n3\n7\n4\n5\n6\n8\n"), "x,y,z,i\n1,2,3,7\n4,5,6,8\n"},
      {"wrapped_rows.ply", ply(kXyz + "property uchar i\n", "\n1 2\n3 7 4\n\n5 6 8"), "x,y,z,i\n1,2,3,7\n4,5,6,8\n"},
      {"label_extra_line.pcd", replaced(pcd("x y z", "4 4 4", "F F F", "1 2 3\n4 5 6\n"), "DATA", "LABEL scan 7\nDATA"),
       kPlain},
      {"label_extra_line.pcd",
       replaced(pcd("x y z", "4 4 4", "F F F", packed<float>({1, 2, 3, 4, 5, 6}), "binary"), "VERSION",
                "SENSOR lidar front left\nVERSION"),
       kPlain},
  };
  return all;
}

// Lines before the first row.
inline const std::vector<Given>& fronts_of_text() {
  const std::string with_i = "x,y,z,i\n1,2,3,7\n4,5,6,8\n", intensity = "x,y,z,intensity\n1,2,3,7\n4,5,6,8\n";
  static const std::vector<Given> all = {
      {"cc_count.asc", "//X Y Z Intensity\r\n2\r\n1 2 3 7\r\n4 5 6 8\r\n", "x,y,z,Intensity\n1,2,3,7\n4,5,6,8\n"},
      {"cc_count.csv", "//X;Y;Z;i\n2\n1;2;3;7\n4;5;6;8\n", with_i},
      {"cc_count.txt", "2\n1\t2\t3\t7\n4\t5\t6\t8\n", "x,y,z,column_4\n1,2,3,7\n4,5,6,8\n"},
      {"cc_count.xyz", " 2 \r\n1 2 3\r\n4 5 6\r\n", kPlain},
      {"two_scans.pts", "1\n1 2 3 7\n\n1\n4 5 6 8\n", intensity},
      {"two_scans.pts", "2\r1 2 3 7 10 20 30\r4 5 6 8 40 50 255\r1\r7 8 9 9 1 2 3\r",
       "x,y,z,intensity,red,green,blue\n1,2,3,7,10,20,30\n4,5,6,8,40,50,255\n7,8,9,9,1,2,3\n"},
      {"title_line.xyz", "Tunnel 7\n(from the north, 2 men)\n1 2 3\n4 5 6\n", kPlain, "lines before the first row"},
      {"title_line.csv", "Survey of 3 May\r\nx,y,z,i\r\n1,2,3,7\r\n4,5,6,8\r\n", with_i},
      {"units_row.csv", "x;y;z;i\nmm;mm;mm;-\n1;2;3;7\n4;5;6;8\n", with_i},
      {"units_row.txt", "X Y Z\n(m) (m) (m)\n1 2 3\n4 5 6\n", kPlain},
      {"percent_comment.txt", "% x y z i\n1 2 3 7\n4 5 6 8\n", with_i},
      {"percent_comment.csv", "%%% head\n%\nx,y,z\n1,2,3\n4,5,6\n% end\n", kPlain},
      {"easting.txt", "Northing Easting Height Code\n2 1 3 7\n5 4 6 8\n", "x,y,z,Code\n1,2,3,7\n4,5,6,8\n"},
      {"easting.csv", "Rechtswert;Hochwert;Hoehe;i\n1,0;2,0;3,0;7\n4,0;5,0;6,0;8\n", with_i},
      {"paraview.csv", "Points:2,Points:1,Points:0\n3,2,1\n6,5,4\n", kPlain},
      {"paraview.csv", "\"i\";\"Points_0\";\"Points_1\";\"Points_2\"\r\n7;1;2;3\r\n8;4;5;6\r\n", with_i},
      {"units_in_names.csv", "x (mm);y (mm);z (mm);i\n1;2;3;7\n4;5;6;8\n", with_i},
      {"units_in_names.txt", "X[ft] Y[ft] Z[ft]\n1 2 3\n4 5 6\n", kPlain},
  };
  return all;
}

// How numbers are written.
inline const std::vector<Given>& words() {
  const std::string halves = "x,y,z,i\n1.5,2.25,3,7\n4,5,-6.75,8\n", nans = "x,y,z\nnan,nan,nan\n4,5,6\n";
  static const std::vector<Given> all = {
      {"quoted_numbers.csv",
       "\"x\";\"y\";\"z\";\"i\"\r\n\"1.5\";\"2.25\";\"3\";\"7\"\r\n\"4\";\"5\";\"-6.75\";\"8\"\r\n", halves},
      {"quoted_numbers.txt", "x y z i\n\"1.5\" \"2.25\" 3 7\n4 5 \"-6.75\" 8\n", halves},
      {"empty_xyz_fields.csv", "x;y;z;i\r\n;;;7\r\n4;5;6;8\r\n", "x,y,z,i\nnan,nan,nan,7\n4,5,6,8\n"},
      {"empty_xyz_fields.csv", "i,x,y,z\n7,,,\n8,4,5,6\n", "x,y,z,i\nnan,nan,nan,7\n4,5,6,8\n"},
      {"nan_msvc_old.csv", "x,y,z\n-1.#IND,1.#QNAN,-1.#IND00\n4,5,6\n", nans},
      {"nan_msvc_old.ply", ply(kXyz, "1.#QNAN -1.#IND 1.#QNAN0\n4 5 6\n"), nans},
      {"decimal_comma_semicolon.csv", "i;x;y;z\r\n7;1,5;2,25;3\r\n8;4;5;-6,75\r\n", halves},
      {"decimal_comma_semicolon.txt", "1,5; 2,25; 3,0\n4,0; 5,0; -6,75\n", "x,y,z\n1.5,2.25,3\n4,5,-6.75\n"},
      {"decimal_comma_space.txt", "x y z i\n1,5 2,25 3,0 7\n4,0 5,0 -6,75 8\n", halves},
      {"decimal_comma_space.pts", "2\n1,5 2,25 3,0 7\n4,0 5,0 -6,75 8\n", replaced(halves, ",i", ",intensity")},
  };
  return all;
}

// Scans with poses: a turn by 90 degrees, and none.
inline const std::vector<Given>& scans() {
  const std::string turned = "1 2 3\n0 1 0\n-1 0 0\n0 0 1\n0 1 0 0\n-1 0 0 0\n0 0 1 0\n1 2 3 1\n",
                    plain = "0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
  static const std::vector<Given> all = {
      {"scan.ptx", "2\r\n1\r\n" + replaced(turned, "\n", "\r\n") + "1 0 0 0.5\r\n0 0 0 0.5\r\n",
       "x,y,z,intensity\n1,3,3,0.5\nnan,nan,nan,0.5\n"},
      {"scan.ptx", "1\n1\n" + plain + "1 2 3 0.5\n1\n1\n" + turned + "1 0 0 0.25 10 20 255\n",
       "x,y,z,intensity,red,green,blue,scan\n1,2,3,0.5,nan,nan,nan,0\n1,3,3,0.25,10,20,255,1\n"},
  };
  return all;
}

}  // namespace variants

inline std::vector<Given> all_files() {
  using namespace variants;
  std::vector<Given> all = all_given();
  for (const auto* table :
       {&bytes(), &colors(), &parts(), &numbers(), &tokens(), &fronts_of_text(), &words(), &scans()})
    all.insert(all.end(), table->begin(), table->end());
  return all;
}

}  // namespace pointfair::test
