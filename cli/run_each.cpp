// SPDX-License-Identifier: Apache-2.0
#include "run_each.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <new>
#include <optional>
#include <string>
#include <vector>

#include "output.hpp"
#include "pointfair/pointfair.hpp"
#include "survey.hpp"

namespace pointfair::cli {
namespace {

namespace fs = std::filesystem;

struct Row {
  fs::path input, output;
  std::string status = "waiting", error{};  // done, skipped or failed afterwards
  ErrorKind kind = ErrorKind::failed;       // of the error
  std::optional<Told> told{};               // of this run
  std::string numbers{};                    // the same as CSV; of a file that is skipped, as the table had it
  Json run{};                               // the same as JSON
};

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

void set_told(Row& row, const std::optional<Told>& told) {
  const auto known = [](const std::optional<double>& value) {
    return value ? fmt::format("{}", *value) : std::string();
  };
  row.told = told;
  row.numbers = told ? fmt::format("{},{},{},{},{},{},{},{}", told->points, known(told->spacing), known(told->noise),
                                   told->moved_mean, told->moved_max, told->outliers, told->milliseconds,
                                   known(told->metres_per_unit))
                     : "";
  row.run = told ? told->json : Json();
}

// The table of a run over many files on their own, which --report names; empty: none. A row a file, which is on the
// disk while the run goes on.
class Table {
 public:
  explicit Table(std::string report) : report_(std::move(report)) {}
  // Gives the rows the numbers that the table has of their outputs, where it is there, from an earlier run.
  void take_over(std::vector<Row>& rows) const;
  // Writes it unless that would take more than a fiftieth of the time. What cannot be written now may be at the end.
  void update(const std::vector<Row>& rows);
  void write(const std::vector<Row>& rows) const;

 private:
  using Clock = std::chrono::steady_clock;
  std::string report_;
  Clock::time_point next_{};
};

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

// The input's name, with the extension of the format that is asked for. What is no known extension is part of a name.
fs::path name_of_result(const fs::path& input, const FormatArguments& asked) {
  const std::optional<Format> format = make_write_options(asked, {}).format;
  const fs::path plain = TiledRun::output_name(input);  // of an octree, NAME.laz
  const bool is_octree = plain != input.filename();
  const std::optional<Format> own = is_octree ? Format::copc : format_of(plain);
  if (!format || own == format) return input.filename();
  fs::path name = own ? plain.stem() : plain;
  return name += *format == Format::copc ? ".copc.laz" : "." + asked.format;
}

std::vector<Row> planned(const RunArguments& arguments) {
  std::vector<Row> rows;
  std::map<fs::path, fs::path> inputs;  // by their results
  for (const fs::path& input : files_of_survey(arguments.inputs(), arguments.in.format)) {
    const fs::path output = fs::path(arguments.tiled.out_dir) / name_of_result(input, arguments.format);
    if (const auto [other, is_new] = inputs.try_emplace(output, input); !is_new)
      throw Error(ErrorKind::usage,
                  fmt::format("{}: its result would have the same name as that of {}, {}; run them one after the "
                              "other, into two folders",
                              input.string(), other->second.string(), output.string()));
    rows.push_back({input, output});
  }
  return rows;
}

std::vector<fs::path> files_of(const std::vector<Row>& rows) {
  std::vector<fs::path> files;
  for (const Row& row : rows) files.insert(files.end(), {row.input, row.output});
  return files;
}

void check_each(const RunArguments& arguments) {
  const std::string extension = fs::path(arguments.report).extension().string();
  if (!arguments.report.empty() && arguments.report != "-" && extension != ".csv" && extension != ".json")
    throw Error(ErrorKind::usage,
                fmt::format("--report {}: of many files the report has a row each; name a .csv or .json "
                            "file. pointfair certify IN OUT makes the page of one",
                            arguments.report));
  if (!arguments.tiled.work.empty() || arguments.tiled.tiles > 1)
    throw Error(ErrorKind::usage,
                "--each runs every file on its own; leave out --work and --tiles, or leave out --each");
}

// At the end all errors stand together, so each says which file it is about.
std::string naming(const Row& row, const std::string& error) {
  for (const fs::path& path : {row.input, row.output})
    if (error.find(path.string()) != std::string::npos) return error;
  return row.input.string() + ": " + error;
}

// The run of a file. One without points is copied: a tile without a return is no failure.
Told ran_or_copied(const RunArguments& of_file, const RunFile& run_file, Progress& progress) {
  try {
    return run_file(of_file, progress);
  } catch (const NoPoints&) {
    check_paths(of_file);
    WriteOptions options = make_write_options(of_file.format, of_file.output);
    options.overwrite = of_file.force;
    copy_without_points(of_file.input, of_file.output, options);
  }
  Findings none;
  none.is_copied = true;
  none.notes = {"the file has no points and was copied"};
  return told_of(none);
}

// Runs one; what goes wrong is written down.
void run_row(const RunArguments& arguments, const RunFile& run_file, Progress& progress, Row& row) {
  std::error_code failed;
  if (arguments.skip_existing && fs::exists(row.output, failed) && !fs::equivalent(row.input, row.output, failed)) {
    row.status = "skipped";
    return;
  }
  RunArguments of_file = arguments;
  of_file.input = row.input.string();
  of_file.output = row.output.string();
  of_file.more.clear();
  of_file.tiled.out_dir.clear();
  of_file.report.clear();
  of_file.quiet = true;
  row.status = "failed";
  set_told(row, {});
  try {
    set_told(row, ran_or_copied(of_file, run_file, progress));
    row.status = "done";
  } catch (const Error& error) {
    if (error.kind() == ErrorKind::interrupted) throw;
    row.error = naming(row, error.what());
    row.kind = error.kind();
  } catch (const std::bad_alloc&) {
    row.error = row.input.string() + ": out of memory; close other programs or give --memory";
    row.kind = ErrorKind::memory;
  }
}

void print_row(const Row& row, std::size_t number, std::size_t all) {
  const std::string place = fmt::format("[{}/{}] {}", number, all, row.input.string());
  if (!row.told)
    return print_message("{}: {}\n", place, row.status == "skipped" ? "its result is there, skipped" : row.status);
  const Told& told = *row.told;
  if (told.is_copied) {
    print_message("{}: {} points, written as they were\n", place, told.points);
  } else {
    const std::string noise = told.noise ? fmt::format("noise {:.4g}, ", *told.noise) : std::string();
    print_message("{}: {} points, {}moved {:.4g} on average, {:.4g} at most, {} outliers\n", place, told.points, noise,
                  told.moved_mean, told.moved_max, told.outliers);
  }
  for (const std::string& note : told.notes) print_message("note: {}\n", note);
}

// Throws if some failed.
void conclude(const RunArguments& arguments, const std::vector<Row>& rows) {
  const auto count = [&](const char* status) { return std::ranges::count(rows, status, &Row::status); };
  const auto failures = count("failed");
  if (!arguments.quiet)
    print_message("{} of {} files written, {} skipped, {} failed\n", count("done"), rows.size(), count("skipped"),
                  failures);
  std::vector<ErrorKind> kinds;
  for (const Row& row : rows) {
    if (row.status != "failed") continue;
    print_error(row.error);
    kinds.push_back(row.kind);
  }
  if (!kinds.empty())
    throw Error(common_kind(kinds),
                fmt::format("{} of {} files failed; the lines above say why", failures, rows.size()));
}

}  // namespace

void run_each(const RunArguments& arguments, const RunFile& run_file, std::stop_token stop) {
  check_each(arguments);
  std::vector<Row> rows = planned(arguments);
  check_page(arguments.report, files_of(rows));
  Table table(arguments.report);
  if (arguments.skip_existing) table.take_over(rows);
  const ResultFolder folder(arguments.tiled.out_dir);
  if (!arguments.quiet && rows.size() > 1)
    print_message("{} files, each on its own; without --each they would be one cloud\n", rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (stop.stop_requested()) throw Error(ErrorKind::interrupted, "interrupted");
    {
      Progress progress(arguments.quiet ? "none" : arguments.progress);
      progress.set_part(fmt::format("{}/{} ", i + 1, rows.size()), double(i) / double(rows.size()),
                        1 / double(rows.size()));
      run_row(arguments, run_file, progress, rows[i]);
    }
    if (!arguments.quiet) print_row(rows[i], i + 1, rows.size());
    table.update(rows);
  }
  table.write(rows);
  conclude(arguments, rows);
}

}  // namespace pointfair::cli
