// SPDX-License-Identifier: Apache-2.0
// picture: draws clouds side by side from one camera into a PNG file.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <sstream>

#include "drawing.hpp"
#include "png_file.hpp"

namespace {

using namespace picture;

constexpr int kNormalNeighbors = 20;

struct Arguments {
  std::vector<std::string> clouds, normals;
  std::string out, frame;
  std::array<float, 2> angles{}, focus{};
  float zoom = 1, spot = 0.9f;  // such spots just cover what is behind the surface
  std::array<int, 2> panel = {PanelSize{}.width, PanelSize{}.height};
};

pointfair::Params one_iteration() {
  pointfair::Params params;
  params.iterations = 1;
  return params;
}

// "k=8 constraint=on", as the command line of `pointfair run` has them.
pointfair::Params read_params(const std::string& text) {
  pointfair::Params params = one_iteration();
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    const std::size_t equals = std::min(word.find('='), word.size());
    const pointfair::ParamInfo* info = pointfair::find_param(word.substr(0, equals));
    if (info == nullptr || equals == word.size())
      throw pointfair::Error(pointfair::ErrorKind::usage, "--normals: '" + word + "' is not NAME=VALUE of a parameter");
    set_param(params, *info, word.substr(equals + 1));
  }
  return params;
}

// Degrees between computed normals and those that the cloud's file states, the mean over all points; a point without
// a normal counts as 90. Empty where the file states none.
std::optional<double> mean_angle_error(const pointfair::Cloud& cloud, const pointfair::Params& params) {
  std::array<pointfair::Attribute, 3> stated;
  try {
    stated = {attribute(cloud, "nx"), attribute(cloud, "ny"), attribute(cloud, "nz")};
  } catch (const pointfair::Error&) {
    return std::nullopt;
  }
  for (const pointfair::Attribute& column : stated)
    if (column.type != pointfair::ScalarType::float32) return std::nullopt;
  const auto value = [&](int axis, std::size_t i) {
    return double(reinterpret_cast<const float*>(stated[axis].data.data())[i]);
  };
  pointfair::Pipeline pipeline;
  pipeline.load(cloud);
  pipeline.run(params);
  std::vector<pointfair::Point> normals(cloud.points.size());
  pipeline.normals(normals);
  double sum = 0;
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const double x = value(0, i), y = value(1, i), z = value(2, i);
    const double cosine = std::abs(normals[i].x * x + normals[i].y * y + normals[i].z * z) / std::hypot(x, y, z);
    sum += std::acos(std::min(1.0, cosine));
  }
  return sum / double(normals.size()) * 180 / 3.14159265358979;
}

// Panels side by side.
class Strip {
 public:
  Strip(PanelSize panel, std::size_t panels)
      : panel_(panel), width_(panel.width * int(panels)), rgb_(std::size_t(3) * width_ * panel.height) {}

  void add(const std::vector<unsigned char>& pixels) {
    const std::size_t row = std::size_t(3) * panel_.width;
    for (int y = 0; y < panel_.height; ++y)
      std::copy_n(pixels.begin() + long(y * row), row, rgb_.begin() + long(std::size_t(3) * width_ * y + left_));
    left_ += row;
  }
  void write(const std::string& path) const { write_png(path, rgb_, width_, panel_.height); }

 private:
  PanelSize panel_;
  int width_;
  std::size_t left_ = 0;
  std::vector<unsigned char> rgb_;
};

void draw_clouds(const Arguments& arguments, const Camera& camera, PanelSize panel) {
  pointfair::Params params = one_iteration();
  params.k = kNormalNeighbors;
  Strip strip(panel, arguments.clouds.size());
  for (const std::string& cloud : arguments.clouds)
    strip.add(draw_clay(make_surface(pointfair::read(cloud), params), camera, panel));
  strip.write(arguments.out);
}

void draw_normals(const Arguments& arguments, const Camera& camera, PanelSize panel) {
  Strip strip(panel, arguments.clouds.size() * arguments.normals.size());
  for (const std::string& path : arguments.clouds) {
    const pointfair::Cloud cloud = pointfair::read(path);
    for (const std::string& text : arguments.normals) {
      const pointfair::Params params = read_params(text);
      strip.add(draw_directions(make_surface(cloud, params), camera, panel, arguments.spot));
      if (const auto error = mean_angle_error(cloud, params)) std::printf("%.3f  %s\n", *error, text.c_str());
    }
  }
  strip.write(arguments.out);
}

void make_picture(const Arguments& arguments) {
  const PanelSize panel{arguments.panel[0], arguments.panel[1]};
  const View view{arguments.angles[0], arguments.angles[1], arguments.zoom, arguments.focus[0], arguments.focus[1]};
  const Camera camera =
      make_camera(pointfair::read(arguments.frame.empty() ? arguments.clouds.back() : arguments.frame), view, panel);
  if (arguments.normals.empty())
    draw_clouds(arguments, camera, panel);
  else
    draw_normals(arguments, camera, panel);
}

}  // namespace

int main(int argc, char** argv) try {
  CLI::App app("Draws clouds side by side from one camera.");
  Arguments arguments;
  app.add_option("CLOUD", arguments.clouds, "clouds, from left to right")->required();
  app.add_option("--out", arguments.out, "PNG file to write")->required();
  app.add_option("--frame", arguments.frame, "cloud that fills the panel at zoom 1; default: the last")
      ->type_name("CLOUD");
  app.add_option("--angles", arguments.angles, "azimuth and elevation, degrees");
  app.add_option("--zoom", arguments.zoom, "1: the whole cloud")->check(CLI::PositiveNumber);
  app.add_option("--focus", arguments.focus, "what is in the middle, right and up, of half the height at zoom 1");
  app.add_option("--panel", arguments.panel, "width and height of a panel, pixels")->check(CLI::Range(16, 8192));
  app.add_option(
         "--normals", arguments.normals,
         "instead of clay: points in the colours of the normals that these parameters give, 'k=8 "
         "constraint=on'; each gives a panel, and a line with the mean error in degrees if the file has normals")
      ->type_name("PARAMS")
      ->allow_extra_args(false);
  app.add_option("--spot", arguments.spot, "with --normals: radius of a point, in mean spacings")
      ->check(CLI::PositiveNumber);
  CLI11_PARSE(app, argc, argv);
  make_picture(arguments);
  return 0;
} catch (const std::exception& error) {
  std::cerr << "picture: " << error.what() << '\n';
  return 1;
}
