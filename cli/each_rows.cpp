// SPDX-License-Identifier: Apache-2.0
#include "each_rows.hpp"

#include <fmt/format.h>

#include <fstream>
#include <iterator>
#include <map>

#include "output.hpp"

namespace pointfair::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kHeader =
    "input,output,status,points,spacing,noise,moved_mean,moved_max,outliers,milliseconds,metres_per_unit,error";
constexpr std::string_view kNoNumbers = ",,,,,,,";
constexpr std::size_t kOutput = 1, kFirstNumber = 3, kNumbers = 8, kFields = 12;

Json json_of(const Row& row) {
  Json json{{"input", row.input.string()}, {"output", row.output.string()}, {"status", row.status}};
  if (!row.error.empty()) json["error"] = row.error;
  if (!row.run.is_null()) json["run"] = row.run;
  return json;
}

std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

std::string csv_of(const std::vector<Row>& rows) {
  std::string text = fmt::format("{}\n", kHeader);
  for (const Row& row : rows)
    text += fmt::format("{},{},{},{},{}\n", csv_field(row.input.string()), csv_field(row.output.string()), row.status,
                        row.numbers.empty() ? kNoNumbers : row.numbers, csv_field(row.error));
  return text;
}

// The fields of all lines, without what quotes them.
std::vector<std::vector<std::string>> fields_of(const std::string& csv) {
  std::vector<std::vector<std::string>> lines(1, {""});
  bool is_quoted = false;
  char before = 0;
  for (const char c : csv) {
    if (c == '"') {
      if (!is_quoted && before == '"') lines.back().back() += c;  // the second of two
      is_quoted = !is_quoted;
    } else if (is_quoted || (c != ',' && c != '\n')) {
      lines.back().back() += c;
    } else if (c == ',') {
      lines.back().emplace_back();
    } else {
      lines.push_back({""});
    }
    before = c;
  }
  return lines;
}

std::map<std::string, std::string> numbers_in(const std::string& csv) {
  std::map<std::string, std::string> numbers;
  if (!csv.starts_with(kHeader)) return numbers;
  for (const std::vector<std::string>& fields : fields_of(csv)) {
    if (fields.size() != kFields) continue;
    std::string& its = numbers[fields[kOutput]];
    its = fields[kFirstNumber];
    for (std::size_t i = 1; i < kNumbers; ++i) its += "," + fields[kFirstNumber + i];
  }
  return numbers;
}

std::map<std::string, Json> runs_in(const std::string& text) {
  std::map<std::string, Json> runs;
  const Json json = Json::parse(text, nullptr, false);
  if (!json.is_object() || !json.contains("files") || !json["files"].is_array()) return runs;
  for (const Json& row : json["files"])
    if (row.is_object() && row.contains("run") && row.value("output", Json()).is_string())
      runs[row["output"].get<std::string>()] = row["run"];
  return runs;
}

}  // namespace

void set_findings(Row& row, const std::optional<Findings>& findings) {
  row.findings = findings;
  const bool is_measured = findings && !findings->is_copied;
  const std::string measured = is_measured ? fmt::format("{},{}", findings->spacing, findings->noise) : ",";
  const std::string unit =
      findings && findings->metres_per_unit ? fmt::format("{}", *findings->metres_per_unit) : std::string();
  row.numbers = findings ? fmt::format("{},{},{},{},{},{},{}", findings->report.points, measured,
                                       findings->displacement.mean, findings->displacement.max,
                                       found_outliers(findings->report), findings->report.total_milliseconds, unit)
                         : "";
  row.run = findings ? run_json(findings->report, *findings) : Json();
}

void Table::take_over(std::vector<Row>& rows) const {
  std::ifstream file(report_, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  auto numbers = numbers_in(text);
  auto runs = runs_in(text);
  for (Row& row : rows) {
    row.numbers = numbers[row.output.string()];
    row.run = runs[row.output.string()];
  }
}

void Table::update(const std::vector<Row>& rows) {
  std::error_code failed;
  const Clock::time_point begin = Clock::now();
  const bool is_stream = fs::exists(report_, failed) && !fs::is_regular_file(report_, failed);
  if (report_.empty() || report_ == "-" || is_stream || begin < next_) return;
  try {
    write(rows);
  } catch (const Error&) {
  }
  const Clock::time_point end = Clock::now();
  next_ = end + 50 * (end - begin);
}

void Table::write(const std::vector<Row>& rows) const {
  if (report_.empty()) return;
  if (fs::path(report_).extension() == ".csv") return write_text(report_, csv_of(rows));
  Json files = Json::array();
  for (const Row& row : rows) files.push_back(json_of(row));
  write_report(report_, {{"version", version()}, {"files", files}});
}

}  // namespace pointfair::cli
