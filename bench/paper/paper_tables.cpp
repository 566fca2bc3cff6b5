// SPDX-License-Identifier: Apache-2.0
// The paper's table II and figures 6 and 7 on this machine, as CSV: pointfair on the CPU and on a card, and on the same
// card the paper's own design and brute force. bench/paper_tables.py makes the clouds, and tables and plots of the CSV.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>

#include "paper/agreement.hpp"
#include "paper/baselines.hpp"
#include "pointfair/pointfair.hpp"

namespace {

using pointfair::Device;
using pointfair::Params;
using pointfair::Point;
using Points = std::vector<Point>;

constexpr int kTableK = 8;
constexpr int kTableResolutions[] = {32, 64, 128, 256, 512};
constexpr int kFigureResolutions[] = {16, 32, 64, 128, 256, 512, 1024};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

template <class Work>
double milliseconds(const Work& work) {
  const auto start = std::chrono::steady_clock::now();
  work();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

// A file of comma-separated values, complete after every row.
class Csv {
 public:
  Csv(const std::filesystem::path& path, const std::string& header) : file_(path) {
    if (!file_) throw std::runtime_error(path.string() + ": cannot be written");
    file_ << header << std::endl;
  }
  template <class... Values>
  void row(const Values&... values) {
    const char* comma = "";
    ((file_ << comma << values, comma = ","), ...);
    file_ << std::endl;
  }

 private:
  std::ofstream file_;
};

// Medians from array to array, copies included, and of stages; the first run warms up and does not count.
struct Measured {
  double whole = 0;
  std::map<std::string, double> stages;
  Points faired;
};

// Eq. 1 to 6 in one pass, squared area weight, no constraint; widths from the data, measured once and not timed.
Params settings_for(const Points& points, int k) {
  Params params;
  params.k = k;
  params.passes = 1;
  params.area_weight = pointfair::AreaWeight::squared;
  pointfair::Pipeline pipeline(Device::cpu);
  pipeline.load(points);
  return pipeline.resolve(params);
}

Measured measure(pointfair::Pipeline& pipeline, const Points& points, const Params& params, int repeat) {
  Measured result;
  result.faired.resize(points.size());
  std::vector<double> whole;
  std::map<std::string, std::vector<double>> stages;
  for (int i = 0; i <= repeat; ++i) {
    const double time = milliseconds([&] {
      pipeline.load(points);
      pipeline.run(params, result.faired);
    });
    if (i == 0) continue;
    whole.push_back(time);
    for (const pointfair::StageTime& stage : pipeline.report().stages) stages[stage.name].push_back(stage.milliseconds);
  }
  result.whole = median(whole);
  for (const auto& [name, times] : stages) result.stages[name] = median(times);
  return result;
}

paper::Settings baseline_settings(paper::Search search, int resolution, const Params& params) {
  return {search,
          params.k,
          resolution,
          static_cast<float>(params.normal_sigma.value),
          static_cast<float>(params.closeness_sigma.value),
          static_cast<float>(params.similarity_sigma.value)};
}

Measured measure(paper::CudaBaseline& baseline, const Points& points, const paper::Settings& settings, int repeat) {
  Measured result;
  result.faired.resize(points.size());
  std::vector<double> whole, index, search;
  for (int i = 0; i <= repeat; ++i) {
    const double time = milliseconds([&] { baseline.run(points, settings, result.faired); });
    if (i == 0) continue;
    whole.push_back(time);
    index.push_back(double(baseline.times().index));
    search.push_back(double(baseline.times().search));
  }
  result.whole = median(whole);
  result.stages = {{"index", median(index)}, {"neighbors", median(search)}};
  return result;
}

// What every contender must find on one cloud with one k.
struct Truth {
  const Points& points;
  const Points& faired;       // by pointfair on the CPU
  std::optional<double> sum;  // of the distances to the last neighbours, once a baseline agreed with a plain loop
};

// All that is measured on one machine.
class Tables {
 public:
  Tables(std::filesystem::path out, int repeat) : out_(std::move(out)), repeat_(repeat) {
    std::filesystem::create_directories(out_);
    std::ofstream environment(out_ / "environment.txt");
    std::string missing = "no CUDA";
    for (const pointfair::DeviceStatus& status : pointfair::list_devices()) {
      environment << status.info.name << ": " << status.info.reason << '\n';
      for (const std::string& detail : status.details) environment << "  " << detail << '\n';
      if (status.info.kind != Device::cuda || missing.empty()) continue;
      missing = status.usable ? "" : status.info.reason;
    }
    if (missing.empty()) {
      card_.emplace(Device::cuda);
      baseline_.emplace();
    } else {
      environment << "columns of a card: missing, " << missing << '\n';
      std::printf("The columns of a card are missing: %s\n", missing.c_str());
    }
  }

  bool wrong() const { return wrong_; }

  void table2(const std::vector<std::string>& clouds) {
    Csv csv(out_ / "table2.csv", "points,contender,resolution,ms,sum_of_last_distances");
    for (const std::string& file : clouds) {
      const Points points = pointfair::read(file).points;
      const Params params = settings_for(points, kTableK);
      const auto row = [&](const char* contender, const std::string& resolution, double ms, const std::string& sum) {
        csv.row(points.size(), contender, resolution, ms, sum);
        std::printf("table II  %8zu  %-20s %6s %12.3f ms\n", points.size(), contender, resolution.c_str(), ms);
        std::fflush(stdout);
      };
      const Measured cpu = measure(cpu_, points, params, repeat_);
      row("pointfair CPU", "", cpu.whole, "");
      if (!card_) continue;
      const Measured cuda = measure(*card_, points, params, repeat_);
      if (agrees("pointfair CUDA", paper::compare_points(cuda.faired, cpu.faired)))
        row("pointfair CUDA", "", cuda.whole, "");
      Truth truth{points, cpu.faired, {}};
      for (const int resolution : kTableResolutions) {
        const auto settings = baseline_settings(paper::Search::dense_grid, resolution, params);
        const auto grid = measure_checked(truth, settings, repeat_);
        if (grid) row("paper's design", std::to_string(resolution), grid->whole, sum_text());
      }
      const auto settings = baseline_settings(paper::Search::brute_force, 0, params);
      const auto brute = measure_checked(truth, settings, points.size() > 200000 ? 1 : repeat_);
      if (brute) row("brute force", "", brute->whole, sum_text());
    }
  }

  // Index and search of the paper's design over resolution and k; pointfair's own stages do not depend on a resolution.
  void figures(const std::string& cloud) {
    const Points points = pointfair::read(cloud).points;
    Csv figure6(out_ / "figure6.csv", "points,contender,resolution,ms");
    Csv figure7(out_ / "figure7.csv", "points,contender,k,resolution,ms,sum_of_last_distances");
    for (const int k : paper::kListLengths) {
      const Params params = settings_for(points, k);
      const Measured cpu = measure(cpu_, points, params, repeat_);
      note(figure6, figure7, points.size(), "pointfair CPU", k, cpu);
      if (!card_) continue;
      const Measured cuda = measure(*card_, points, params, repeat_);
      if (!agrees("pointfair CUDA", paper::compare_points(cuda.faired, cpu.faired))) continue;
      note(figure6, figure7, points.size(), "pointfair CUDA", k, cuda);
      Truth truth{points, cpu.faired, {}};
      for (const int resolution : kFigureResolutions) {
        if (!paper::CudaBaseline::fits(points, resolution)) continue;
        const auto settings = baseline_settings(paper::Search::dense_grid, resolution, params);
        const auto grid = measure_checked(truth, settings, repeat_);
        if (!grid) continue;
        if (k == kTableK) figure6.row(points.size(), "paper's design", resolution, grid->stages.at("index"));
        figure7.row(points.size(), "paper's design", k, resolution, grid->stages.at("neighbors"), sum_text());
      }
      const auto settings = baseline_settings(paper::Search::brute_force, 0, params);
      const auto brute = measure_checked(truth, settings, 1);
      if (brute) figure7.row(points.size(), "brute force", k, "", brute->stages.at("neighbors"), sum_text());
      std::printf("figures   %8zu  k %d\n", points.size(), k);
      std::fflush(stdout);
    }
  }

 private:
  void note(Csv& figure6, Csv& figure7, std::size_t points, const char* contender, int k, const Measured& measured) {
    if (k == kTableK) figure6.row(points, contender, "", measured.stages.at("index"));
    figure7.row(points, contender, k, "", measured.stages.at("neighbors"), "");
  }

  bool agrees(const std::string& who, const std::string& difference) {
    if (difference.empty()) return true;
    std::printf("WRONG: %s: %s\n", who.c_str(), difference.c_str());
    wrong_ = true;
    return false;
  }

  // Nothing, and a complaint, if neighbours or faired points are not those of pointfair.
  std::optional<Measured> measure_checked(Truth& truth, const paper::Settings& settings, int repeat) {
    Measured result = measure(*baseline_, truth.points, settings, repeat);
    const std::vector<std::uint32_t> rows = baseline_->neighbors();
    sum_ = paper::sum_of_last_distances(truth.points, settings.k, rows);
    std::string difference = paper::compare_points(result.faired, truth.faired);
    if (difference.empty() && !truth.sum) difference = paper::compare_samples(truth.points, settings.k, rows);
    if (difference.empty() && truth.sum.value_or(sum_) != sum_) difference = "the sum of the last distances differs";
    const std::string who = settings.search == paper::Search::brute_force
                                ? "brute force"
                                : "paper's design at resolution " + std::to_string(settings.resolution);
    if (!agrees(who, difference)) return std::nullopt;
    truth.sum = sum_;
    return result;
  }

  std::string sum_text() const {
    char text[32];
    std::snprintf(text, sizeof text, "%.17g", sum_);
    return text;
  }

  std::filesystem::path out_;
  int repeat_;
  bool wrong_ = false;
  pointfair::Pipeline cpu_{Device::cpu};
  std::optional<pointfair::Pipeline> card_;
  std::optional<paper::CudaBaseline> baseline_;
  double sum_ = 0;  // of the distances to the last neighbours, by the last baseline that was measured
};

}  // namespace

int main(int argc, char** argv) try {
  CLI::App app("The paper's table II and figures 6 and 7 on this machine, as CSV.");
  std::string out, figure_cloud;
  std::vector<std::string> clouds;
  int repeat = 9;
  app.add_option("--out", out, "folder for the CSV files")->required();
  app.add_option("--figure-cloud", figure_cloud, "cloud of figures 6 and 7")->check(CLI::ExistingFile);
  app.add_option("--repeat", repeat, "median of so many runs, after one to warm up")->check(CLI::Range(1, 1000));
  app.add_option("CLOUDS", clouds, "clouds of table II")->check(CLI::ExistingFile);
  CLI11_PARSE(app, argc, argv);
  Tables tables(out, repeat);
  if (!clouds.empty()) tables.table2(clouds);
  if (!figure_cloud.empty()) tables.figures(figure_cloud);
  return tables.wrong() ? 1 : 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "paper_tables: %s\n", error.what());
  return 1;
}
