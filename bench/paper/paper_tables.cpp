// SPDX-License-Identifier: Apache-2.0
// The paper's table II and figures 6 and 7 on this machine, as CSV: pointfair on the CPU and on a card, and on the same
// card the paper's own design and brute force in two ways. bench/paper_tables.py makes the clouds, and tables and plots
// of the CSV.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <span>

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
constexpr int kHardResolutions[] = {256, 512, 1024};  // of coarser grids one search can take minutes
constexpr std::size_t kManyPoints = 200'000;          // beyond, brute force is measured once
const std::string kDesign = "paper's design", kBrute = "brute force", kTwoKernels = "CUKNN";

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
};

// Eq. 1 to 6 in one pass, squared area weight, no constraint; widths from the data, measured once and not timed.
Params settings_for(const Points& points, int k) {
  pointfair::Pipeline pipeline(Device::cpu);
  pipeline.load(points);
  return pipeline.resolve({.k = k, .area_weight = pointfair::AreaWeight::squared, .iterations = 1});
}

Measured measure(pointfair::Pipeline& pipeline, std::span<const Point> points, const Params& params, int repeat,
                 std::span<Point> out) {
  Measured result;
  std::vector<double> whole;
  std::map<std::string, std::vector<double>> stages;
  for (int i = 0; i <= repeat; ++i) {
    const double time = milliseconds([&] {
      pipeline.load(points);
      pipeline.run(params, out);
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

Measured measure(paper::CudaBaseline& baseline, std::span<const Point> points, const paper::Settings& settings,
                 int repeat, std::span<Point> out) {
  Measured result;
  std::vector<double> whole, index, search;
  for (int i = 0; i <= repeat; ++i) {
    const double time = milliseconds([&] { baseline.run(points, settings, out); });
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
  std::span<const Point> points;
  std::span<const Point> faired;  // by pointfair on the CPU
  std::optional<double> sum;      // of the distances to the last neighbours, once a baseline agreed with a plain loop
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

  void table2(const std::vector<std::string>& clouds) { whole_times("table2", clouds, kTableResolutions, true); }

  // Clouds that a dense grid is not made for. Brute force does not notice and is left out.
  void hard(const std::vector<std::string>& clouds) { whole_times("hard", clouds, kHardResolutions, false); }

  // Index and search over resolution and k; only the paper's design has a resolution.
  void figures(const std::string& cloud) {
    const Points points = pointfair::read(cloud).points;
    Csv figure6(out_ / "figure6.csv", "points,contender,resolution,ms");
    Csv figure7(out_ / "figure7.csv", "points,contender,k,resolution,ms,sum_of_last_distances");
    for (const int k : paper::kListLengths) {
      measure_all(points, k, kFigureResolutions, 1, [&](const Row& row) {
        if (k == kTableK && row.contender != kBrute && row.contender != kTwoKernels)
          figure6.row(points.size(), row.contender, row.resolution, row.measured.stages.at("index"));
        figure7.row(points.size(), row.contender, k, row.resolution, row.measured.stages.at("neighbors"), row.sum);
      });
      std::printf("figures   %8zu  k %d\n", points.size(), k);
      std::fflush(stdout);
    }
  }

 private:
  struct Row {
    std::string contender, resolution;
    const Measured& measured;
    std::string sum;  // of the distances to the last neighbours, where a baseline has it
  };

  void whole_times(const std::string& name, const std::vector<std::string>& clouds, std::span<const int> resolutions,
                   bool with_brute_force) {
    Csv csv(out_ / (name + ".csv"), "cloud,points,contender,resolution,ms,sum_of_last_distances");
    for (const std::string& file : clouds) {
      const Points points = pointfair::read(file).points;
      const std::string cloud = std::filesystem::path(file).stem().string();
      const int brute_repeat = !with_brute_force ? 0 : points.size() > kManyPoints ? 1 : repeat_;
      measure_all(points, kTableK, resolutions, brute_repeat, [&](const Row& row) {
        csv.row(cloud, points.size(), row.contender, row.resolution, row.measured.whole, row.sum);
        std::printf("%-8s %-22s %8zu  %-16s %6s %12.3f ms\n", name.c_str(), cloud.c_str(), points.size(),
                    row.contender.c_str(), row.resolution.c_str(), row.measured.whole);
        std::fflush(stdout);
      });
    }
  }

  // Every contender that this machine can run on one cloud, the paper's design at each resolution that fits; those on
  // the card from and to the same page-locked arrays.
  template <class Emit>
  void measure_all(const Points& points, int k, std::span<const int> resolutions, int brute_repeat, Emit emit) {
    const Params params = settings_for(points, k);
    Points faired(points.size());
    const Measured cpu = measure(cpu_, points, params, repeat_, faired);
    emit(Row{"pointfair CPU", "", cpu, ""});
    if (!card_) return;
    const pointfair::HostBuffer in = card_->host_buffer(points.size()), out = card_->host_buffer(points.size());
    std::copy(points.begin(), points.end(), in.points().begin());
    const Measured cuda = measure(*card_, in.points(), params, repeat_, out.points());
    if (agrees("pointfair CUDA", paper::compare_points(out.points(), faired)))
      emit(Row{"pointfair CUDA", "", cuda, ""});
    Truth truth{in.points(), faired, {}};
    for (const int resolution : resolutions) {
      if (!paper::CudaBaseline::fits(points, resolution)) continue;
      const auto settings = baseline_settings(paper::Search::dense_grid, resolution, params);
      if (const auto grid = measure_checked(truth, settings, repeat_, out.points()))
        emit(Row{kDesign, std::to_string(resolution), *grid, sum_text()});
    }
    if (brute_repeat == 0) return;
    for (const paper::Search search : {paper::Search::brute_force, paper::Search::two_kernels})
      if (const auto brute = measure_checked(truth, baseline_settings(search, 0, params), brute_repeat, out.points()))
        emit(Row{search == paper::Search::brute_force ? kBrute : kTwoKernels, "", *brute, sum_text()});
  }

  bool agrees(const std::string& who, const std::string& difference) {
    if (difference.empty()) return true;
    std::printf("WRONG: %s: %s\n", who.c_str(), difference.c_str());
    wrong_ = true;
    return false;
  }

  // Nothing, and a complaint, if neighbours or faired points are not those of pointfair.
  std::optional<Measured> measure_checked(Truth& truth, const paper::Settings& settings, int repeat,
                                          std::span<Point> out) {
    const Measured result = measure(*baseline_, truth.points, settings, repeat, out);
    const std::vector<std::uint32_t> rows = baseline_->neighbors();
    sum_ = paper::sum_of_last_distances(truth.points, settings.k, rows);
    std::string difference = paper::compare_points(out, truth.faired);
    if (difference.empty() && !truth.sum) difference = paper::compare_samples(truth.points, settings.k, rows);
    if (difference.empty() && truth.sum.value_or(sum_) != sum_) difference = "the sum of the last distances differs";
    const std::string who = settings.search == paper::Search::brute_force ? kBrute
                            : settings.search == paper::Search::two_kernels
                                ? kTwoKernels
                                : kDesign + " at resolution " + std::to_string(settings.resolution);
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
  std::vector<std::string> clouds, hard_clouds;
  int repeat = 9;
  app.add_option("--out", out, "folder for the CSV files")->required();
  app.add_option("--figure-cloud", figure_cloud, "cloud of figures 6 and 7")->check(CLI::ExistingFile);
  app.add_option("--hard", hard_clouds, "clouds of uneven density or with a stray point")->check(CLI::ExistingFile);
  app.add_option("--repeat", repeat, "median of so many runs, after one to warm up")->check(CLI::Range(1, 1000));
  app.add_option("CLOUDS", clouds, "clouds of table II")->check(CLI::ExistingFile);
  CLI11_PARSE(app, argc, argv);
  Tables tables(out, repeat);
  if (!clouds.empty()) tables.table2(clouds);
  if (!hard_clouds.empty()) tables.hard(hard_clouds);
  if (!figure_cloud.empty()) tables.figures(figure_cloud);
  return tables.wrong() ? 1 : 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "paper_tables: %s\n", error.what());
  return 1;
}
