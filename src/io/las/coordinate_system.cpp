// SPDX-License-Identifier: Apache-2.0
#include "io/las/coordinate_system.hpp"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "io/text.hpp"

namespace pointfair::io::las {
namespace {

constexpr const char* kUser = "LASF_Projection";
constexpr unsigned kWkt = 2112, kGeoKeys = 34735, kGeoText = 34737;

// Well-known text is KEYWORD[value, KEYWORD[...], ...]. This walks through its nodes and picks out what is wanted.
class WktReader {
 public:
  explicit WktReader(std::string_view text) : rest_(text) {}

  CoordinateSystem read() {
    for (std::vector<std::string> path; !rest_.empty();) {
      const char c = rest_.front();
      if (c == '"') {
        const std::size_t end = std::min(rest_.find('"', 1), rest_.size() - 1);
        take_value(path, rest_.substr(1, end - 1));
        rest_.remove_prefix(end + 1);
      } else if (c == '[' || c == '(') {
        path.push_back(std::exchange(word_, {}));
        values_.emplace_back();
        rest_.remove_prefix(1);
      } else if (c == ']' || c == ')' || c == ',') {
        if (!word_.empty()) take_value(path, std::exchange(word_, {}));
        if (c != ',' && !path.empty()) {
          end_node(path);
          path.pop_back();
          values_.pop_back();
        }
        rest_.remove_prefix(1);
      } else {
        if (!is_blank(c) && c != '\n' && c != '\0') word_ += c;
        rest_.remove_prefix(1);
      }
    }
    if (!code_.empty()) result_.name += (result_.name.empty() ? "" : ", ") + code_;
    return result_;
  }

 private:
  static bool is_one_of(const std::string& word, std::initializer_list<std::string_view> names) {
    return std::ranges::find(names, word) != names.end();
  }

  void take_value(const std::vector<std::string>& path, std::string_view value) {
    if (values_.empty()) return;
    if (path.size() == 1 && values_.back().empty()) result_.name = value;
    values_.back().emplace_back(value);
  }

  // A unit counts if it is not of angles: those stand in the geographic part. Heights have theirs in a system or an
  // axis of their own.
  void end_node(const std::vector<std::string>& path) {
    const std::string& node = path.back();
    const std::vector<std::string>& values = values_.back();
    const auto lies_in = [&](std::initializer_list<std::string_view> names) {
      return std::ranges::any_of(path, [&](const std::string& word) { return is_one_of(word, names); });
    };
    if (is_one_of(node, {"UNIT", "LENGTHUNIT"}) && values.size() >= 2 &&
        !lies_in({"GEOGCS", "BASEGEOGCRS", "GEOGCRS", "BASEGEODCRS", "GEODCRS", "GEODETICCRS", "CONVERSION",
                  "ELLIPSOID", "PRIMEM"})) {
      const std::vector<std::string>* const axis =
          path.size() > 1 && path[path.size() - 2] == "AXIS" ? &values_[values_.size() - 2] : nullptr;
      const bool is_up = axis && axis->size() > 1 && is_one_of((*axis)[1], {"up", "down"});
      const bool is_of_heights = is_up || lies_in({"VERT_CS", "VERTCRS", "VERTICALCRS"});
      std::optional<double>& unit = is_of_heights ? result_.metres_per_height : result_.metres_per_unit;
      const std::optional<double> metres = to_number(values[1]);
      if (!unit && metres && *metres > 0) unit = metres;
    }
    const bool is_horizontal = std::all_of(path.begin(), path.end() - 1, [](const std::string& word) {
      return is_one_of(word, {"COMPD_CS", "COMPOUNDCRS", "BOUNDCRS", "SOURCECRS"});
    });
    if (is_horizontal && is_one_of(node, {"GEOGCS", "GEOGCRS", "GEOGRAPHICCRS"})) result_.is_geographic = true;
    if (is_horizontal && is_one_of(node, {"GEODCRS", "GEODETICCRS"}) && has_angles_) result_.is_geographic = true;
    if (node == "CS" && !values.empty()) has_angles_ = values[0] == "ellipsoidal";
    if (is_one_of(node, {"AUTHORITY", "ID"}) && path.size() == 2 && values.size() >= 2)
      code_ = values[0] + ":" + values[1];
  }

  std::string_view rest_;
  std::string word_, code_;
  std::vector<std::vector<std::string>> values_;  // of the nodes that are open
  bool has_angles_ = false;                       // the axes that were named last
  CoordinateSystem result_;
};

// GeoTIFF's keys: numbers of four 16-bit values each, the first of which counts them.
std::map<unsigned, unsigned> short_keys(std::string_view data) {
  std::map<unsigned, unsigned> keys;
  if (data.size() < 8) return keys;
  const std::size_t count = std::min<std::size_t>(get<std::uint16_t>(data, 6), (data.size() - 8) / 8);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t at = 8 + 8 * i;
    const bool here = get<std::uint16_t>(data, at + 2) == 0;  // else in another record
    if (here) keys[get<std::uint16_t>(data, at)] = get<std::uint16_t>(data, at + 6);
  }
  return keys;
}

// The UTM zones of WGS 84, ETRS89 and NAD83, whose codes alone say that they are in metres.
bool is_utm(unsigned code) {
  return (code >= 32601 && code <= 32660) || (code >= 32701 && code <= 32760) || (code >= 25828 && code <= 25838) ||
         (code >= 26901 && code <= 26923);
}

CoordinateSystem from_keys(std::string_view data, std::string_view text) {
  constexpr unsigned kModel = 1024, kGeographic = 2048, kProjected = 3072, kLinearUnits = 3076, kVerticalUnits = 4099;
  constexpr unsigned kGeographicModel = 2;
  constexpr unsigned kMetre = 9001, kFoot = 9002, kSurveyFoot = 9003, kUserDefined = 32767;
  const std::map<unsigned, unsigned> keys = short_keys(data);
  const auto value = [&](unsigned key) { return keys.count(key) != 0 ? keys.at(key) : 0; };
  CoordinateSystem result;
  result.name = text.substr(0, text.find_first_of(std::string_view("|\0", 2)));
  for (const unsigned code : {value(kProjected), value(kGeographic)}) {
    if (code == 0 || code == kUserDefined) continue;
    result.name += (result.name.empty() ? "" : ", ") + ("EPSG:" + std::to_string(code));
    break;
  }
  const unsigned model = value(kModel);
  result.is_geographic =
      value(kProjected) == 0 && (model == kGeographicModel || (model == 0 && value(kGeographic) != 0));
  const auto metres_of = [&](unsigned key) -> std::optional<double> {
    const unsigned unit = value(key);
    if (unit == kMetre) return 1;
    if (unit == kFoot) return 0.3048;
    return unit == kSurveyFoot ? std::optional(1200.0 / 3937) : std::nullopt;
  };
  result.metres_per_unit = metres_of(kLinearUnits);
  if (value(kLinearUnits) == 0 && is_utm(value(kProjected))) result.metres_per_unit = 1;
  result.metres_per_height = metres_of(kVerticalUnits);
  return result;
}

}  // namespace

bool has_geotiff_keys(const Header& header) { return header.find(kUser, kGeoKeys) && !header.find(kUser, kWkt); }

CoordinateSystem coordinate_system(const Header& header) {
  if (const Record* const wkt = header.find(kUser, kWkt)) return WktReader(wkt->data).read();
  const Record* const keys = header.find(kUser, kGeoKeys);
  const Record* const text = header.find(kUser, kGeoText);
  return keys ? from_keys(keys->data, text ? text->data : std::string_view()) : CoordinateSystem{};
}

}  // namespace pointfair::io::las
