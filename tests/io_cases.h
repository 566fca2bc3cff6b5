// SPDX-License-Identifier: Apache-2.0
// Files as people and other programs write them. What each holds is written by hand, as CSV.
#pragma once

#include <string>
#include <vector>

#include "io_files.h"

namespace pointfair::test {

inline const std::string kMark = "\xEF\xBB\xBF";

inline std::string ply(const std::string& properties, const std::string& body, int points = 2) {
  return "ply\nformat ascii 1.0\nelement vertex " + std::to_string(points) + "\n" + properties + "end_header\n" + body;
}
inline const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size())
    text.replace(at, from.size(), to);
  return text;
}
inline std::string with_cr(const std::string& text) { return replaced(text, "\n", "\r"); }

struct Given {
  std::string name, bytes, csv;
  std::string lost = {};  // words of what is told when it becomes a file of the other format
  Format other = Format::ply;
};

// A byte order mark is skipped, and lines may end in '\r' alone.
inline const std::vector<Given>& marks_and_line_ends() {
  static const std::vector<Given> all = {
      {"a.off", kMark + "OFF\r\n2 0 0\r\n1 2 3\r\n4 5 6\r\n", "x,y,z\n1,2,3\n4,5,6\n"},
      {"a.xyz", kMark + "1 2 3\n4 5 6\n", "x,y,z\n1,2,3\n4,5,6\n"},
      {"a.pcd", kMark + "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n",
       "x,y,z\n1,2,3\n"},
      {"a.csv", "x,y,z,i\r1,2,3,7\r4,5,6,8", "x,y,z,i\n1,2,3,7\n4,5,6,8\n"},
      {"a.off", with_cr("OFF\n2 0 0\n1 2 3\n4 5 6\n"), "x,y,z\n1,2,3\n4,5,6\n"},
      {"a.pts", "2\r1 2 3 9\r4 5 6 8\r", "x,y,z,intensity\n1,2,3,9\n4,5,6,8\n"},
      {"a.pcd", with_cr("VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 2\nDATA ascii\n1 2 3\n4 5 6\n"),
       "x,y,z\n1,2,3\n4,5,6\n"},
  };
  return all;
}

// Titles, remarks, counts, names and units before the first row, and how coordinates are called.
inline const std::vector<Given>& fronts() {
  const std::string csv = "x,y,z\n1,2,3\n4,5,6\n", with_i = "x,y,z,i\n1,2,3,7\n4,5,6,8\n";
  static const std::vector<Given> all = {
      {"a.asc", "//X Y Z Rf Gf Bf I\n2\n1 2 3 0 0.2 1 7\n4 5 6 1 0.4 0 8\n",
       "x,y,z,red,green,blue,I\n1,2,3,0,51,255,7\n4,5,6,255,102,0,8\n"},
      {"a.csv", "2\n1,2,3\n4,5,6\n", csv},
      {"a.pts", "1\r\n1 2 3 7\r\n1\r\n4 5 6 8\r\n", replaced(with_i, "i\n", "intensity\n")},
      {"a.txt", "Survey of 3 May\nby hand\n\n1 2 3\n4 5 6\n", csv},
      {"a.csv", "A title, with a comma\nx,y,z\n1,2,3\n4,5,6\n", csv},
      {"a.csv", "x;y;z;i\n[m];[m];[m];[-]\n1;2;3;7\n4;5;6;8\n", with_i},
      {"a.txt", "% exported by MATLAB\n1 2 3\n4 5 6\n", csv},
      {"a.xyz", "1 2 3\n% a remark\n4 5 6\n", csv},
      {"a.csv", "Easting,Northing,Elevation\n1,2,3\n4,5,6\n", csv},
      {"a.csv", "id,EAST,NORTH,Height\n9,1,2,3\n9,4,5,6\n", "x,y,z,id\n1,2,3,9\n4,5,6,9\n"},
      {"a.csv", "Hochwert;Rechtswert;H\xC3\xB6he\n2;1;3\n5;4;6\n", csv},
      {"a.csv", "Hochwert;Rechtswert;H\xC3\x96HE\n2;1;3\n5;4;6\n", csv},
      {"a.txt", "X[m] Y(m) Z [m] i\n1 2 3 7\n4 5 6 8\n", with_i},
      {"a.txt", "x_coord y_coord z_coord\n1 2 3\n4 5 6\n", csv},
      {"a.txt", "# POINT_X POINT_Y POINT_Z\n1 2 3\n4 5 6\n", csv},
      {"a.csv", "Este,Norte,Cota\n1,2,3\n4,5,6\n", csv},
      {"a.csv", "Est;Nord;Quota\n1;2;3\n4;5;6\n", csv},
      {"a.csv", "Oost;Noord;Hoogte\n1;2;3\n4;5;6\n", csv},
  };
  return all;
}

// How numbers and words are written.
inline const std::vector<Given>& spellings() {
  const std::string csv = "x,y,z\n1.5,2,3\n4,5.25,6\n", with_i = "x,y,z,i\n1.5,2,3,7\n4,5.25,6,8\n";
  static const std::vector<Given> all = {
      {"a.csv", "\"x\";\"y\";\"z\"\n\"1,5\";\"2\";\"3\"\n\"4\";\"5,25\";\"6\"\n", csv},
      {"a.csv", "label,x,y,z\n\"a, b\",1.5,2,3\n\"c \"\"d\"\", e\",4,5.25,6\n", csv},
      {"a.txt", "x\ty\tz\n1,5\t2,0\t3,0\n4,0\t5,25\t6,0\n", csv},
      {"a.csv", "x,y,z,i\n,,,7\n4,5.25,,8\n", "x,y,z,i\nnan,nan,nan,7\n4,5.25,nan,8\n"},
      {"a.txt", "x\ty\tz\tq\ti\n1.5\t2\t3\t\t7\n4\t5.25\t6\t\t8\n", with_i},
      {"a.xyz", "1.#QNAN -1.#IND 1.#INF\n4 5.25 6\n", "x,y,z\nnan,nan,inf\n4,5.25,6\n"},
      {"a.xyz", "nan(ind) -nan(ind) -1.#INF00\n4 5.25 6\n", "x,y,z\nnan,-nan,-inf\n4,5.25,6\n"},
      {"a.xyz", "NA NA NA\n4 5.25 6\n", "x,y,z\nnan,nan,nan\n4,5.25,6\n"},
      {"a.csv", "x,y,z\n1.5,2,3\n4,5.25,6\n\x1A", csv},
      {"a.csv", "x,y,z,x,red,R\n1,2,3,4,5,6\n", "x,y,z,x_2,red,R\n1,2,3,4,5,6\n"},
      {"a.csv", "x,y,z,t\n1,2,3,1234567890123456789\n4,5,6,-1\n", "x,y,z,t\n1,2,3,1234567890123456789\n4,5,6,-1\n"},
      {"a.csv", "x,y,z,t\n1,2,3,18446744073709551615\n", "x,y,z,t\n1,2,3,18446744073709551615\n"},
  };
  return all;
}

// Values on other lines than usual, other names of types, other cases.
inline const std::vector<Given>& shapes() {
  const std::string csv = "x,y,z\n1,2,3\n4,5,6\n";
  const std::string off = "1 2 3\n4 5 6\n2 0 1\n";
  static const std::vector<Given> all = {
      {"a.off", "OFF 2 1 0\n" + off, csv},
      {"a.off", "OFF\n2 1\n" + off, csv},
      {"a.off", replaced("OFF\n2 1 0\n" + off, " ", "\n"), csv},
      {"a.off", "OFF # a remark\n\n2 1 0 # counts\n1 2\n3 4 5\n6 2 0 1\n", csv},
      {"a.off", "OFF\n2 2 0\n1 2 3\n4 5 6\n2 0 1 2 1 0\n", csv},
      {"a.off", "OFF\n2 0 0\n1 2 3 10 20 30\n4 5 6 40 50 60\n",
       "x,y,z,red,green,blue\n1,2,3,10,20,30\n4,5,6,40,50,60\n"},
      {"a.off", "COFF\n1 0 0\n1 2 3 0 0.2 1 1\n", "x,y,z,red,green,blue,alpha\n1,2,3,0,51,255,1\n"},
      {"a.off", "STOFF\n1 0 0\n1 2 3 0.5 0.25\n", "x,y,z,s,t\n1,2,3,0.5,0.25\n"},
      {"a.ply", ply(kXyz + "property uint64 id\n", "1 2 3 18446744073709551615\n4 5 6 7\n"),
       "x,y,z,id\n1,2,3,18446744073709551615\n4,5,6,7\n"},
      {"a.ply", ply(kXyz, "1 2 3 4 5 6\n"), csv},
      {"a.pcd", "version 0.7\nfields x y z\nsize 4 4 4\ntype F F F\npoints 2\ndata ASCII\n1 2 3\n4 5 6\n", csv},
      {"a.pcd",
       "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nFRAME_ID lidar\nPOINTS 2\nDATA ascii\n1 2 3\n4 5 6\n", csv},
      {"a.pcd",
       "VERSION 0.7\nFIELDS x y z t\nSIZE 4 4 4 8\nTYPE F F F U\nSTAMP 12.5\nPOINTS 1\nDATA binary\n" +
           packed<float>({1, 2, 3}) + packed<std::uint64_t>({1234567890123456789U}),
       "x,y,z,t\n1,2,3,1234567890123456789\n"},
      {"a.obj", "# a folder\\\nv 1 2 3\nv 4 5\\\n 6\nf 1 \\\n2 1\n", csv},
      {"a.obj", "v 1 2 3\nv 4 5 6 255 0 51\n", "x,y,z,red,green,blue\n1,2,3,nan,nan,nan\n4,5,6,255,0,51\n"},
      {"a.obj", "v 1 2 3 0 1 0.2\nv 4 5 6 1 0 0\n", "x,y,z,red,green,blue\n1,2,3,0,255,51\n4,5,6,255,0,0\n"},
      {"a.obj", "v 1 2 3 0 128 255\nv 4 5 6 9 8 7\n", "x,y,z,red,green,blue\n1,2,3,0,128,255\n4,5,6,9,8,7\n"},
      {"a.obj", "v 1 2 3\nvn 0 0 1\nv 4 5 6\nvn 0 1 0\n", "x,y,z,nx,ny,nz\n1,2,3,0,0,1\n4,5,6,0,1,0\n"},
      {"a.obj", "v 1 2 3\nv 4 5 6\nvn 0 0 1\nf 1//1 2//1 1//1\n", "x,y,z,nx,ny,nz\n1,2,3,0,0,1\n4,5,6,0,0,1\n"},
  };
  return all;
}

// Found by looking for further kinds.
inline const std::vector<Given>& further() {
  const std::string csv = "x,y,z\n1.5,2,3\n4,5.25,6\n", with_i = "x,y,z,i\n1.5,2,3,7\n4,5.25,6,8\n";
  static const std::vector<Given> all = {
      {"r.txt", "\"x\" \"y\" \"z\"\n\"1\" 1.5 2 3\n\"2\" 4 5.25 6\n", "x,y,z,row\n1.5,2,3,1\n4,5.25,6,2\n"},  // R
      {"excel.csv", "sep=;\nx;y;z\n1.5;2;3\n4;5.25;6\n", csv},
      {"fortran.txt", " 0.15D+01 2.0D0 3.d0\n 0.4D+01 5.25d0 6.0D0\n", csv},
      {"swiss.csv", "E;N;H\n2'600'001.5;1'200'002;3\n2'600'004;1'200'005;6\n",
       "x,y,z\n2600001.5,1200002,3\n2600004,1200005,6\n"},
      {"minus.txt",
       "\xE2\x88\x92"
       "1.5 2 3\n4 5.25 \xE2\x88\x92"
       "6\n",
       "x,y,z\n-1.5,2,3\n4,5.25,-6\n"},
      {"trailing.csv", "x,y,z,i,\n1.5,2,3,7,\n4,5.25,6,8,\n", with_i},
      {"tabs.txt", "X [m]\tY [m]\tZ [m]\ti\n1.5\t2\t3\t7\n4\t5.25\t6\t8\n", with_i},
      {"spaces_in_words.txt", "x\ty\tz\tname\ti\n1.5\t2\t3\told oak\t7\n4\t5.25\t6\tbig red ash\t8\n", with_i},
      {"blanks.csv", "x , y , z , i\n 1.5 , 2 , 3 , 7 \n4,  5.25,6,8\n", with_i},
      {"quoted_blanks.txt", "x y z name i\n1.5 2 3 \"old oak\" 7\n4 5.25 6 \"ash\" 8\n", with_i},
      {"arcgis.txt", "POINT_X,POINT_Y,POINT_Z\n1.5,2,3\n4,5.25,6\n", csv},
      {"units.txt", "Easting(m) Northing(m) Elev.(m)\n1.5 2 3\n4 5.25 6\n", csv},
      {"dos.xyz", "1.5 2 3\r\n4 5.25 6\r\n\x1A", csv},
      {"pandas.csv", ",x,y,z\n0,1.5,2,3\n1,4,5.25,6\n", "x,y,z,unnamed\n1.5,2,3,0\n4,5.25,6,1\n"},
      {"tinyply.ply",
       ply("property float32 x\nproperty float32 y\nproperty float32 z\nproperty int8 i\n", "1.5 2 3 7\n4 5.25 6 8\n"),
       with_i},
  };
  return all;
}

// And how further programs write what they export.
inline const std::vector<Given>& habits() {
  const std::string csv = "x,y,z\n1.5,2,3\n4,5.25,6\n", with_i = "x,y,z,i\n1.5,2,3,7\n4,5.25,6,8\n",
                    intensity = "x,y,z,intensity\n1.5,2,3,7\n4,5.25,6,8\n";
  const std::string pcd = "VERSION .7\nFIELDS x y z i\nSIZE 4 4 4 1\nTYPE F F F U\nCOUNT 1 1 1 1\nWIDTH 2\nHEIGHT 1\n";
  static const std::vector<Given> all = {
      // text
      {"pdal.txt", "\"X\",\"Y\",\"Z\",\"i\"\n1.500,2.000,3.000,7.000\n4.000,5.250,6.000,8.000\n", with_i},
      {"lastools.txt", "# x y z i\n1.5 2 3 7\n4 5.25 6 8\n", with_i},
      {"matlab.dat.txt",
       "  1.5000000e+00   2.0000000e+00   3.0000000e+00\n  4.0000000e+00   5.2500000e+00   6.0000000e+00\n", csv},
      {"numpy.txt", "# 1: x\n# 2: y\n# 3: z\n1.500000000000000000e+00 2.000000000000000000e+00 3.0e+00\n4 5.25 6\n",
       csv},
      {"surfer.dat.csv", "\"Easting\",\"Northing\",\"Elevation\"\r\n1.5,2,3\r\n4,5.25,6\r\n", csv},
      {"plus.xyz", "+1.5 +2 +3\n+4 +5.25 +6\n", csv},
      {"points.xyz", ".15e1 2. 3\n4. 5.25 6.\n", csv},
      {"blank_lines.xyz", "\n1.5 2 3\n\n\n4 5.25 6\n\n", csv},
      {"blanks_at_the_end.xyz", "1.5 2 3   \n4 5.25 6\t\n", csv},
      {"mixed_ends.xyz", "1.5 2 3\r\n4 5.25 6\n", csv},
      {"mark_and_names.csv", kMark + "x,y,z,i\n1.5,2,3,7\n4,5.25,6,8\n", with_i},
      {"mark_and_quotes.csv", kMark + "\"x\";\"y\";\"z\"\n1,5;2;3\n4;5,25;6\n", csv},
      {"no_end.xyz", "1.5 2 3\n4 5.25 6", csv},
      {"null.csv", "x,y,z,i\nnull,2,3,7\n4,5.25,6,8\n", "x,y,z,i\nnan,2,3,7\n4,5.25,6,8\n"},
      {"cyclone.pts", "2 \r\n1.5 2 3 7\r\n4 5.25 6 8\r\n", intensity},
      {"blanks_before.pts", "   2\n  1.5 2 3 7\n  4 5.25 6 8\n", intensity},
      // PLY, PCD, OFF and OBJ
      {"upper_keyword.ply", ply(replaced(kXyz, "float", "double"), "1.5 2 3\n4 5.25 6\n"), csv},
      {"blank_in_header.ply",
       replaced(ply(kXyz, "1.5 2 3\n4 5.25 6\n"), "format ascii 1.0\n", "format ascii 1.0 \nobj_info made by hand\n"),
       csv},
      {"obj_info.ply", replaced(ply(kXyz, "1.5 2 3\n4 5.25 6\n"), "element", "comment a\nobj_info b\nelement"), csv},
      {"pcl.pcd",
       "# .PCD v.7 - Point Cloud Data file format\n" + pcd +
           "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA ascii\n1.5 2 3 7\n4 5.25 6 8\n",
       with_i},
      {"crlf.pcd", replaced(pcd + "POINTS 2\nDATA ascii\n1.5 2 3 7\n4 5.25 6 8\n", "\n", "\r\n"), with_i},
      {"nan.pcd",
       "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\nPOINTS 2\nDATA ascii\nnan nan nan\n4 5.25 6\n",
       "x,y,z\nnan,nan,nan\n4,5.25,6\n"},
      {"geomview.off", "OFF\n# by hand\n2 0 0\n\n1.5 2 3\n# between\n4 5.25 6\n", csv},
      {"blanks.off", "  OFF  \n  2   0 0\n 1.5  2 3\n 4 5.25 6 \n", csv},
      {"blender.obj",
       "# Blender\nmtllib a.mtl\no Cube\nv 1.500000 2.000000 3.000000\nv 4.000000 5.250000 6.000000\ns off\nf 1 2 1\n",
       csv},
      {"indented.obj", "  v 1.5 2 3\n\tv 4 5.25 6\n", csv},
      {"tabs.obj", "v\t1.5\t2\t3\nv\t4\t5.25\t6\n", csv},
      {"negative.obj", "v 1.5 2 3\nv 4 5.25 6\nf -1 -2 -1\n", csv},
  };
  return all;
}

// Found by trying what else could go wrong.
inline const std::vector<Given>& finds() {
  const std::string csv = "x,y,z\n1.5,2,3\n4,5.25,6\n", with_i = "x,y,z,i\n1.5,2,3,7\n4,5.25,6,8\n",
                    first_missing = "x,y,z\nnan,nan,nan\n4,5.25,6\n";
  const std::string pcd = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 2\nHEIGHT 1\n",
                    ptx = "1\n1\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
  static const std::vector<Given> all = {
      {"pandas_none.csv", "x,y,z\nNone,None,None\n4,5.25,6\n", first_missing},
      {"excel_na.csv", "x;y;z\n#N/A;#N/A;#N/A\n4;5.25;6\n", first_missing},
      {"tabs_behind_commas.csv", "x,\ty,\tz\n1.5,\t2,\t3\n4,\t5.25,\t6\n", csv},
      {"remarks.obj", "v 1.5 2 3 # first\nv 4 5.25 6\n", csv},
      {"remarks_behind_colors.obj", "v 1 2 3 1 0 0.2 # a\nv 4 5 6 0 1 0 # b\n",
       "x,y,z,red,green,blue\n1,2,3,255,0,51\n4,5,6,0,255,0\n"},
      {"long_remarks.obj", "v 1.5 2 3 # a remark of many words\nv 4 5.25 6 #b\n", csv},
      {"weights.obj", "v 1.5 2 3 1 # a\nv 4 5.25 6 0.5\n", "x,y,z,w\n1.5,2,3,1\n4,5.25,6,0.5\n"},
      {"points.obj", "o a\nv 1.5 2 3\no b\nv 4 5.25 6\np 1 2\n", csv},
      {"without_points.pcd", pcd + "DATA ascii\n1.5 2 3\n4 5.25 6\n", csv},
      {"padding.pcd",
       "VERSION 0.7\nFIELDS x y z _ i\nSIZE 4 4 4 1 4\nTYPE F F F U F\nCOUNT 1 1 1 4 1\nWIDTH 2\nHEIGHT 1\nPOINTS 2\n"
       "DATA ascii\n1.5 2 3 0 0 0 0 7\n4 5.25 6 0 0 0 0 8\n",
       with_i},
      {"faces_first.ply",
       "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\nelement vertex 2\n" + kXyz +
           "end_header\n3 0 1 0\n1.5 2 3\n4 5.25 6\n",
       csv},
      {"list_first.ply", ply("property list uchar int a\n" + kXyz, "2 7 7 1.5 2 3\n0 4 5.25 6\n"), csv},
      {"blank_lines_at_the_end.ply", ply(kXyz, "1.5 2 3\n4 5.25 6\n\n\n"), csv},
      {"without_intensity.ptx", replaced(ptx, "1\n1\n0", "2\n1\n0") + "1.5 2 3\n4 5.25 6\n", csv},
      {"blank_lines.ptx", "\n" + ptx + "1.5 2 3 0.5\n\n\n" + ptx + "4 5.25 6 0.5\n\n",
       "x,y,z,intensity,scan\n1.5,2,3,0.5,0\n4,5.25,6,0.5,1\n"},
      {"without_count.pts", "1.5 2 3 7\n4 5.25 6 8\n", "x,y,z,intensity\n1.5,2,3,7\n4,5.25,6,8\n"},
      {"remark_and_count.pts", "# made\n2\n1.5 2 3 7\n4 5.25 6 8\n", "x,y,z,intensity\n1.5,2,3,7\n4,5.25,6,8\n"},
      {"count_and_blank.xyz", "2\n\n1.5 2 3\n4 5.25 6\n", csv},
      {"separators_at_the_end.txt", "1.5;2;3;\n4;5.25;6;\n", csv},
      {"zeros.txt", "001.500 002.000 +003\n4 5.25 6\n", csv},
      {"names_in_capitals.csv", "XCOORD,YCOORD,ZCOORD\n1.5,2,3\n4,5.25,6\n", csv},
      {"positions.csv", "position_x,position_y,position_z,i\n1.5,2,3,7\n4,5.25,6,8\n", with_i},
      {"names_with_blanks.txt", "\"X coord\" \"Y coord\" \"Z coord\" i\n1.5 2 3 7\n4 5.25 6 8\n", with_i},
      {"empty_row.csv", "x;y;z\n1.5;2;3\n;;\n4;5.25;6\n", "x,y,z\n1.5,2,3\nnan,nan,nan\n4,5.25,6\n"},
  };
  return all;
}

inline std::vector<Given> all_given() {
  std::vector<Given> all;
  for (const auto* table :
       {&marks_and_line_ends(), &fronts(), &spellings(), &shapes(), &further(), &habits(), &finds()})
    all.insert(all.end(), table->begin(), table->end());
  return all;
}

}  // namespace pointfair::test
