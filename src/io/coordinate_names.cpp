// SPDX-License-Identifier: Apache-2.0
#include "io/coordinate_names.hpp"

#include <algorithm>
#include <set>
#include <span>

#include "io/text.hpp"

namespace pointfair::io {
namespace {

// As plain() leaves them, the plainest first. English, German, French, Italian, Spanish, Portuguese, Dutch; ParaView,
// ArcGIS, R, MATLAB.
constexpr std::string_view kX[] = {
    "x",      "points0",    "coordinates0", "coordinate0", "xcoord",     "xcoordinate", "coordx",   "coordinatex",
    "pointx", "posx",       "positionx",    "worldx",      "cartesianx", "easting",     "eastings", "east",
    "e",      "rechtswert", "rechts",       "rw",          "ostwert",    "ost",         "est",      "este",
    "leste",  "oost",       "xkoordinate",  "utmx",        "utme",       "eastingm",    "xm",       "xmm"};
constexpr std::string_view kY[] = {
    "y",           "points1",  "coordinates1", "coordinate1", "ycoord",     "ycoordinate", "coordy",    "coordinatey",
    "pointy",      "posy",     "positiony",    "worldy",      "cartesiany", "northing",    "northings", "north",
    "n",           "hochwert", "hoch",         "hw",          "nordwert",   "nord",        "norte",     "noord",
    "ykoordinate", "utmy",     "utmn",         "northingm",   "ym",         "ymm"};
constexpr std::string_view kZ[] = {
    "z",      "points2",  "coordinates2", "coordinate2", "zcoord",     "zcoordinate", "coordz", "coordinatez",
    "pointz", "posz",     "positionz",    "worldz",      "cartesianz", "elevation",   "height", "elev",
    "h",      "altitude", "alt",          "level",       "hoehe",      "höhe",        "quota",  "cota",
    "altura", "hoogte",   "zkoordinate",  "rl",          "altezza",    "elevationm",  "zm",     "zmm"};
constexpr std::span<const std::string_view> kNames[] = {kX, kY, kZ};

// In small letters, without the unit in brackets and without what joins words.
std::string plain(std::string_view name) {
  const std::size_t bracket = name.find_first_of("[(");
  if (bracket != std::string_view::npos && bracket > 0) name = name.substr(0, bracket);
  std::string result;
  for (const char c : lower_case(name)) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte >= 'a' && byte <= 'z') || (byte >= '0' && byte <= '9') || byte >= 128) result += c;
  }
  // lower_case() leaves the first; the others are of Latin-1, which spreadsheets write
  for (const std::string_view umlaut : {"\xC3\x96", "\xF6", "\xD6"})
    if (const std::size_t at = result.find(umlaut); at != std::string::npos) result.replace(at, umlaut.size(), "ö");
  return result;
}

// The first bytes of the name, whole letters of UTF-8.
std::string cut(const std::string& name, std::size_t longest) {
  constexpr unsigned kFollows = 0x80, kMask = 0xC0;
  if (name.size() <= longest) return name;
  while (longest > 0 && (static_cast<unsigned char>(name[longest]) & kMask) == kFollows) --longest;
  return name.substr(0, longest);
}

}  // namespace

AxisColumns find_axes(const std::vector<std::string>& names) {
  std::vector<std::string> plain_names;
  for (const std::string& name : names) plain_names.push_back(plain(name));
  AxisColumns columns{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    columns[axis] = names.size();
    for (const std::string_view known : kNames[axis]) {
      const auto found = std::ranges::find(plain_names, known);
      if (found == plain_names.end()) continue;
      columns[axis] = static_cast<std::size_t>(found - plain_names.begin());
      break;
    }
  }
  return columns;
}

std::optional<AxisColumns> find_coordinates(const std::vector<std::string>& names) {
  const AxisColumns columns = find_axes(names);
  const bool all = std::ranges::all_of(columns, [&](std::size_t c) { return c < names.size(); });
  return all ? std::optional(columns) : std::nullopt;
}

std::string listed(const std::vector<std::string>& names) {
  constexpr std::size_t kShown = 12;
  std::string text;
  for (std::size_t i = 0; i < std::min(kShown, names.size()); ++i) text += (i > 0 ? ", " : "") + quoted(names[i]);
  return names.size() > kShown ? text + " and " + std::to_string(names.size() - kShown) + " more" : text;
}

void make_distinct(std::vector<std::string>& names, std::size_t longest) {
  for (std::string& name : names) name = cut(name, longest);
  std::set<std::string> taken(names.begin(), names.end()), seen;
  for (std::string& name : names) {
    if (seen.insert(name).second) continue;
    std::string other;
    for (int number = 2; other.empty() || !taken.insert(other).second; ++number) {
      const std::string digits = std::to_string(number);
      other = cut(name, longest - digits.size() - 1) + "_" + digits;
    }
    name = other;
    seen.insert(other);
  }
}

}  // namespace pointfair::io
