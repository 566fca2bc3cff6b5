// SPDX-License-Identifier: Apache-2.0
// The table of a run over many files on their own: a row a file, which is on the disk while the run goes on.
#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "pointfair/cloud.hpp"
#include "run_report.hpp"

namespace pointfair::cli {

struct Row {
  std::filesystem::path input, output;
  std::string status = "waiting", error{};  // done, skipped or failed afterwards
  ErrorKind kind = ErrorKind::failed;       // of the error
  std::optional<Findings> findings{};       // of this run
  std::string numbers{};                    // the same as CSV; of a file that is skipped, as the table had it
  Json run{};                               // the same as JSON
};

void set_findings(Row& row, const std::optional<Findings>& findings);

/// The table that --report names; empty: none.
class Table {
 public:
  explicit Table(std::string report) : report_(std::move(report)) {}
  /// Gives the rows the numbers that the table has of their outputs, where it is there, from an earlier run.
  void take_over(std::vector<Row>& rows) const;
  /// Writes it unless that would take more than a fiftieth of the time. What cannot be written now may be at the end.
  void update(const std::vector<Row>& rows);
  void write(const std::vector<Row>& rows) const;

 private:
  using Clock = std::chrono::steady_clock;
  std::string report_;
  Clock::time_point next_{};
};

}  // namespace pointfair::cli
