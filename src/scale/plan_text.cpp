// SPDX-License-Identifier: Apache-2.0
// A plan as text.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <locale>
#include <sstream>
#include <string_view>
#include <utility>

#include "io/file_bytes.hpp"
#include "platform/path_text.hpp"
#include "pointfair/version.hpp"
#include "scale/plan.hpp"

namespace pointfair::scale {
namespace {

std::string first_line() { return "pointfair-plan " + std::string(version()) + " files " + std::to_string(kWorkFiles); }

// As "%a", but the same in each locale: other processes, of other machines, read it.
std::string text_of(double value) {
  char digits[32];
  char* end = std::to_chars(digits, digits + sizeof digits, std::fabs(value), std::chars_format::hex).ptr;
  return std::string(std::signbit(value) ? "-0x" : "0x").append(digits, end);
}

double parse_number(std::istream& in) {
  std::string word;
  in >> word;
  const bool minus = word.starts_with('-');
  const std::string_view digits = std::string_view(word).substr(std::min(word.size(), std::size_t(minus ? 3 : 2)));
  double value = std::numeric_limits<double>::quiet_NaN();
  std::from_chars(digits.data(), digits.data() + digits.size(), value, std::chars_format::hex);
  return minus ? -value : value;
}

void read_line(const std::string& line, Plan& plan) {
  std::istringstream in(line);
  in.imbue(std::locale::classic());
  std::string key, word;
  in >> key;
  const auto rest = [&] {
    in.get();
    std::string text;
    std::getline(in, text);
    return text;
  };
  if (key == "memory") in >> plan.memory;
  if (key == "points") in >> plan.points;
  if (key == "iterations") in >> plan.iterations;
  if (key == "tiles") in >> plan.tiles;
  if (key == "origin")
    for (double& c : plan.zones.origin) c = parse_number(in);
  if (key == "zones") {
    plan.zones.side = parse_number(in);
    plan.coordinate_step = parse_number(in);
  }
  if (key == "floats") plan.stores_floats = true;
  if (key == "write") {
    int format = -1, encoding = -1, overwrite = 0, sync = 0;
    in >> format >> encoding;
    const double scale = parse_number(in);
    in >> overwrite >> sync;
    if (format >= 0) plan.write.format = Format(format);
    if (encoding >= 0) plan.write.encoding = Encoding(encoding);
    if (scale > 0) plan.write.las_scale = scale;
    plan.write.overwrite = overwrite != 0;
    plan.write.sync = sync != 0;
  }
  if (key == "param") {
    in >> word;
    if (const ParamInfo* info = find_param(word)) set_param(plan.params, *info, rest());
  }
  if (key == "limit") {
    in >> word;
    set_limit(plan.limits, word, rest());
  }
  if (key == "outliers") {
    int kind = 0, value = -1;
    in >> kind >> value;
    plan.outlier_action.kind = OutlierAction::Kind(kind);
    if (value >= 0) plan.outlier_action.value = static_cast<std::uint8_t>(value);
  }
  if (key == "unit") plan.metres_per_unit = parse_number(in);
  if (key == "noise") plan.noise_attribute = rest();
  if (key == "viewpoint") plan.viewpoint = rest();
  if (key == "seeks_sensor") plan.seeks_sensor = true;
  if (key == "sensor")
    for (double& c : plan.sensor.emplace()) c = parse_number(in);
  if (key == "file") {
    InputFile file;
    in >> file.points >> file.fingerprint;
    file.path = platform::path_of(rest());
    if (!plan.files.empty()) file.first_point = plan.files.back().first_point + plan.files.back().points;
    plan.files.push_back(std::move(file));
  }
  if (key == "system") plan.files.back().coordinate_system = rest();
  if (key == "note") {
    int kind = 0;
    in >> kind;
    plan.files.back().notes.push_back({FileNote::Kind(kind), rest()});
  }
  if (key == "output") plan.files.back().output = platform::path_of(rest());
  if (key == "chunk") {
    InputChunk c;
    in >> c.file >> c.first_block >> c.end_block >> c.first_point >> c.points;
    plan.chunks.push_back(c);
  }
}

}  // namespace

std::string text_of(const Plan& plan) {
  std::ostringstream out;
  out.imbue(std::locale::classic());
  out << first_line() << "\nmemory " << plan.memory << "\npoints " << plan.points << "\niterations " << plan.iterations
      << "\ntiles " << plan.tiles << "\n";
  out << "origin";
  for (const double c : plan.zones.origin) out << " " << text_of(c);
  out << "\nzones " << text_of(plan.zones.side) << " " << text_of(plan.coordinate_step);
  if (plan.stores_floats) out << "\nfloats";
  if (plan.metres_per_unit) out << "\nunit " << text_of(*plan.metres_per_unit);
  out << "\nwrite " << (plan.write.format ? int(*plan.write.format) : -1) << " "
      << (plan.write.encoding ? int(*plan.write.encoding) : -1) << " " << text_of(plan.write.las_scale.value_or(0))
      << " " << int(plan.write.overwrite) << " " << int(plan.write.sync) << "\n";
  for (const ParamInfo& info : kParams) out << "param " << info.name << " " << param_text(plan.params, info) << "\n";
  for (const std::string_view name : kLimitNames) {
    const std::string text = limit_text(plan.limits, name);
    if (!text.empty()) out << "limit " << name << " " << text << "\n";
  }
  if (const OutlierAction& action = plan.outlier_action; action.kind != OutlierAction::Kind::none)
    out << "outliers " << int(action.kind) << " " << (action.value ? int(*action.value) : -1) << "\n";
  if (!plan.noise_attribute.empty()) out << "noise " << plan.noise_attribute << "\n";
  if (!plan.viewpoint.empty()) out << "viewpoint " << plan.viewpoint << "\n";
  if (plan.seeks_sensor) out << "seeks_sensor\n";
  if (plan.sensor) {
    out << "sensor";
    for (const double c : *plan.sensor) out << " " << text_of(c);
    out << "\n";
  }
  for (const InputFile& file : plan.files) {
    out << "file " << file.points << " " << file.fingerprint << " " << platform::text_of(file.path) << "\noutput "
        << platform::text_of(file.output) << "\n";
    if (!file.coordinate_system.empty()) out << "system " << file.coordinate_system << "\n";
    for (const FileNote& note : file.notes) out << "note " << int(note.kind) << " " << note.text << "\n";
  }
  for (const InputChunk& c : plan.chunks)
    out << "chunk " << c.file << " " << c.first_block << " " << c.end_block << " " << c.first_point << " " << c.points
        << "\n";
  out << "end\n";
  return out.str();
}

Plan plan_of(const std::string& text, const std::string& name) {
  std::istringstream lines(text);
  std::string line, last;
  std::getline(lines, line);
  if (line != first_line())
    io::fail(
        name,
        "was made by another version or build of pointfair; go on with that one, or remove the work folder or name "
        "another, and start anew");
  Plan plan;
  for (; std::getline(lines, line); last = line) read_line(line, plan);
  if (last != "end") io::fail(name, "is damaged; plan again in another work folder");
  return plan;
}

}  // namespace pointfair::scale
