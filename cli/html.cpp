// SPDX-License-Identifier: Apache-2.0
#include "html.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "png.hpp"
#include "report.hpp"

namespace pointfair::cli {
namespace {

// The policy lets a browser fetch nothing at all. Contrasts are above 7 to 1.
constexpr std::string_view kPage = R"(<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; img-src data:; style-src 'unsafe-inline'">
<title>{0}</title>
<style>
:root {{ color-scheme: light; font: 15px/1.5 system-ui, sans-serif; color: #1c2126; background: #fff; }}
body {{ max-width: 1080px; margin: 0 auto; padding: 24px 20px 48px; }}
h1 {{ font-size: 26px; line-height: 1.2; margin: 0 0 4px; }}
h2 {{ font-size: 18px; margin: 34px 0 10px; padding-bottom: 4px; border-bottom: 2px solid #1f6f6b; }}
.lead {{ font-size: 17px; margin: 0; }}
.pair {{ display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 420px), 1fr)); gap: 18px; }}
figure {{ margin: 0; break-inside: avoid; }}
figure img, figure svg {{ display: block; width: 100%; height: auto; border: 1px solid #c9ced3; }}
figcaption {{ font-size: 14px; margin-top: 4px; }}
table {{ border-collapse: collapse; margin: 10px 0; width: 100%; font-size: 14px; }}
caption {{ text-align: left; font-weight: 600; padding-bottom: 2px; }}
th, td {{ text-align: left; padding: 3px 12px 3px 0; border-bottom: 1px solid #dde1e5; vertical-align: top; overflow-wrap: anywhere; }}
tbody th {{ font-weight: 400; width: 30%; }}
td {{ font-variant-numeric: tabular-nums; }}
code {{ font: 13px/1.5 ui-monospace, monospace; overflow-wrap: anywhere; }}
.warnings li {{ margin: 4px 0; }}
.warnings {{ border-left: 4px solid #a33b00; padding: 4px 4px 4px 26px; margin: 10px 0; }}
.scale {{ display: grid; grid-template-columns: auto 1fr auto; gap: 8px; align-items: center; font-size: 14px; margin-top: 4px; }}
.scale i {{ height: 12px; }}
.swatch {{ display: inline-block; width: 11px; height: 11px; margin-right: 6px; }}
@media print {{ body {{ max-width: none; padding: 0; }} section, table {{ break-inside: avoid; }} * {{ print-color-adjust: exact; -webkit-print-color-adjust: exact; }} @page {{ margin: 16mm; }} }}
</style>
</head>
<body>
<header><h1>{0}</h1><p class="lead">{1}</p></header>
<main>
{2}</main>
</body>
</html>
)";

}  // namespace

std::string escaped(std::string_view text) {
  // names of files and what files say may be in any encoding; JSON puts a sign in place of what is no UTF-8
  const Json valid = Json::parse(Json(text).dump(-1, ' ', false, Json::error_handler_t::replace));
  std::string result;
  for (const char c : valid.get<std::string>()) {
    if (c == '&')
      result += "&amp;";
    else if (c == '<')
      result += "&lt;";
    else if (c == '>')
      result += "&gt;";
    else if (c == '"')
      result += "&quot;";
    else
      result += c;
  }
  return result;
}

std::string table_of(std::string_view caption, const Pairs& pairs) {
  std::string rows;
  for (const auto& [name, value] : pairs) {
    if (value.empty()) continue;
    rows += fmt::format("<tr><th scope=\"row\">{}</th><td>{}</td></tr>\n", escaped(name), escaped(value));
  }
  return rows.empty()
             ? rows
             : fmt::format("<table><caption>{}</caption><tbody>\n{}</tbody></table>\n", escaped(caption), rows);
}

std::string grid_of(std::string_view caption, const std::vector<std::vector<std::string>>& rows) {
  std::string html = fmt::format("<table><caption>{}</caption>\n", escaped(caption));
  for (std::size_t i = 0; i < rows.size(); ++i) {
    html += i == 0 ? "<thead><tr>" : i == 1 ? "<tbody><tr>" : "<tr>";
    for (std::size_t j = 0; j < rows[i].size(); ++j) {
      const std::string_view cell = i == 0 ? "th scope=\"col\"" : j == 0 ? "th scope=\"row\"" : "td";
      html += fmt::format("<{}>{}</{}>", cell, escaped(rows[i][j]), cell.substr(0, 2));
    }
    html += i == 0 ? "</tr></thead>\n" : "</tr>\n";
  }
  return html + (rows.size() > 1 ? "</tbody></table>\n" : "</table>\n");
}

std::string figure_of(const std::string& png, std::string_view alt, std::string_view caption,
                      std::string_view more_html) {
  return fmt::format(
      "<figure><img src=\"data:image/png;base64,{}\" alt=\"{}\"><figcaption>{}</figcaption>{}</figure>\n",
      base64_of(png), escaped(alt), escaped(caption), more_html);
}

std::string scale_of(std::span<const char* const> colours, std::string_view low, std::string_view high) {
  std::string stops;
  for (const char* colour : colours) stops += fmt::format(", {}", colour);
  return fmt::format(
      "<div class=\"scale\"><span>{}</span><i style=\"background: linear-gradient(to "
      "right{})\"></i><span>{}</span></div>",
      escaped(low), stops, escaped(high));
}

std::string histogram_of(const std::vector<double>& counts, std::string_view alt, std::string_view most,
                         std::string_view axis) {
  constexpr double kWidth = 720, kHeight = 170, kBase = 140;
  const double highest = std::max(1.0, *std::ranges::max_element(counts));
  const double step = kWidth / static_cast<double>(counts.size());
  std::string bars;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const double height = (kBase - 10) * counts[i] / highest;
    fmt::format_to(std::back_inserter(bars), "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"/>",
                   step * double(i) + 0.5, kBase - height, step - 1, height);
  }
  return fmt::format(
      "<figure><svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\"><g fill=\"#1f6f6b\">{}</g>"
      "<path d=\"M0 {}H{}\" stroke=\"#1c2126\"/><g fill=\"#1c2126\" font-size=\"15\">"
      "<text x=\"2\" y=\"161\">0</text><text x=\"360\" y=\"161\" text-anchor=\"middle\">{}</text>"
      "<text x=\"718\" y=\"161\" text-anchor=\"end\">{}</text></g></svg></figure>\n",
      kWidth, kHeight, escaped(alt), bars, kBase, kWidth, escaped(axis), escaped(most));
}

std::string beside(std::initializer_list<std::string_view> html) {
  std::string text = "<div class=\"pair\">\n";
  for (const std::string_view part : html) text.append("<div>").append(part).append("</div>\n");
  return text.append("</div>\n");
}

std::string section_of(std::string_view title, std::string_view html) {
  if (html.empty()) return {};
  return fmt::format("<section><h2>{}</h2>\n{}</section>\n", escaped(title), html);
}

std::string page_of(std::string_view title, std::string_view lead, std::string_view html) {
  return fmt::format(kPage, escaped(title), escaped(lead), html);
}

}  // namespace pointfair::cli
