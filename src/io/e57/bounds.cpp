// SPDX-License-Identifier: Apache-2.0
#include "io/e57/bounds.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <pugixml.hpp>
#include <string_view>

#include "io/text.hpp"

namespace pointfair::io::e57 {
namespace {

constexpr std::array<const char*, 6> kFields = {"cartesianX",     "cartesianY",       "cartesianZ",
                                                "sphericalRange", "sphericalAzimuth", "sphericalElevation"};
// Elements of cartesianBounds and sphericalBounds; the azimuth's say where a sweep starts and ends, which is no bound.
constexpr std::array<const char*, 6> kBounds = {"x", "y", "z", "range", "", "elevation"};

class Widener {
 public:
  explicit Widener(const std::string& xml) : xml_(xml) { document_.load_buffer(xml.data(), xml.size()); }

  std::string widen(const std::vector<Extent>& extents) {
    auto extent = extents.begin();
    for (const pugi::xml_node scan : document_.child("e57Root").child("data3D").children("vectorChild")) {
      if (extent == extents.end()) break;
      widen_scan(scan, *extent++);
    }
    return apply();
  }

 private:
  struct Edit {
    std::size_t begin, end;
    std::string text;
  };

  void widen_scan(const pugi::xml_node& scan, const Extent& extent) {
    for (std::size_t c = 0; c < kFields.size(); ++c) {
      const BoxOf<double>& box = c < 3 ? extent.cartesian : extent.spherical;
      const double least = box.min[c % 3], most = box.max[c % 3];
      if (least > most) continue;
      const pugi::xml_node field = scan.child("points").child("prototype").child(kFields[c]);
      if (std::string_view(field.attribute("type").value()) == "Float") {
        const bool single = std::string_view(field.attribute("precision").value()) == "single";
        widen_attribute(field, "minimum", least, true, single);
        widen_attribute(field, "maximum", most, false, single);
      }
      const std::string bound = kBounds[c];
      const pugi::xml_node bounds = scan.child(c < 3 ? "cartesianBounds" : "sphericalBounds");
      if (bound.empty()) continue;
      widen_element(bounds.child((bound + "Minimum").c_str()), least, true);
      widen_element(bounds.child((bound + "Maximum").c_str()), most, false);
    }
  }

  static bool exceeds(std::string_view bound, double value, bool lower) {
    const std::optional<double> number = bound.empty() ? 0.0 : to_number(bound);
    return number && (lower ? value < *number : value > *number);
  }

  void widen_attribute(const pugi::xml_node& node, const char* key, double value, bool lower, bool single) {
    const pugi::xml_attribute attribute = node.attribute(key);
    if (single) value = static_cast<float>(value);
    if (!attribute || !exceeds(attribute.value(), value, lower)) return;
    const auto tag = static_cast<std::size_t>(node.offset_debug());
    const std::size_t tag_end = xml_.find('>', tag), at = xml_.find(std::string(key) + "=", tag);
    if (at >= tag_end) return;
    const std::size_t quote = at + std::string_view(key).size() + 1, end = xml_.find(xml_[quote], quote + 1);
    if (end >= tag_end) return;
    edits_.push_back({quote + 1, end, text_of(value)});
  }

  // Only a Float: the range of an integer is that of its bits.
  void widen_element(const pugi::xml_node& node, double value, bool lower) {
    if (std::string_view(node.attribute("type").value()) != "Float" || !exceeds(node.child_value(), value, lower))
      return;
    const std::string name = node.name();
    const auto tag = static_cast<std::size_t>(node.offset_debug());
    std::size_t end = xml_.find('>', tag);
    if (end == std::string::npos) return;
    if (xml_[end - 1] != '/') {
      end = xml_.find('>', xml_.find("</" + name, end));
      if (end == std::string::npos) return;
    }
    edits_.push_back({tag - 1, end + 1, "<" + name + " type=\"Float\">" + text_of(value) + "</" + name + ">"});
  }

  static std::string text_of(double value) {
    std::string text;
    append_number(text, value);
    return text;
  }

  std::string apply() {
    if (edits_.empty()) return xml_;
    std::ranges::sort(edits_, {}, &Edit::begin);
    std::string result;
    PatchedText patched(xml_, result);
    for (const Edit& edit : edits_)
      patched.replace(std::string_view(xml_).substr(edit.begin, edit.end - edit.begin), edit.text);
    patched.finish();
    result.resize(std::max(result.size(), xml_.size()), '\n');
    return result;
  }

  const std::string& xml_;
  pugi::xml_document document_;
  std::vector<Edit> edits_;
};

}  // namespace

std::string widened_bounds(const std::string& xml, const std::vector<Extent>& extents) {
  return Widener(xml).widen(extents);
}

}  // namespace pointfair::io::e57
