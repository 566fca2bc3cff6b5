// SPDX-License-Identifier: Apache-2.0
#include "scale/plan.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "estimate/automatic.hpp"
#include "io/box_of.hpp"
#include "io/file_bytes.hpp"
#include "io/no_points.hpp"
#include "io/parallel.hpp"
#include "io/sensor_place.hpp"
#include "io/streamed.hpp"
#include "options/outlier_values.hpp"
#include "platform/files.hpp"
#include "platform/free_memory.hpp"
#include "platform/path_text.hpp"
#include "pointfair/file_info.hpp"
#include "portable.hpp"
#include "scale/given.hpp"
#include "scale/outlier_edits.hpp"
#include "scale/work_file.hpp"
#include "seam/cloud_sample.hpp"
#include "tiles/choice.hpp"

namespace pointfair::scale {
namespace fs = std::filesystem;
namespace {

constexpr std::uint64_t kLeastMemory = std::uint64_t{64} << 20;
constexpr std::uint64_t kBytesOfChunkPoint = 26;  // position, leaf, place in the order, and what is copied
constexpr std::uint64_t kMostOfChunk = std::uint64_t{1} << 25;
constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr std::uint64_t kPointsOfLeaf = 1 << 12, kLeastLeaves = 16, kMostLeaves = 1 << 16;
constexpr std::uint64_t kSampledPoints = 1 << 24, kKeptSamples = 1 << 18;

const fs::path kPlanName = "plan.txt", kTreeName = "leaves";

[[noreturn]] void refuse(const std::string& message) { throw Error(ErrorKind::usage, message); }

std::uint64_t memory_of_task(const TiledJob& job) {
  const std::uint64_t all = HostMemory{job.memory, platform::free_memory()}.usable();
  return std::max(kLeastMemory, all / std::max(1u, job.workers));
}

fs::path whole_path(const fs::path& path) { return fs::absolute(path).lexically_normal(); }

// What has no meaning tile by tile, or is not written that way.
void check_job(const TiledJob& job) {
  check_params(job.params);
  if (job.inputs.empty()) refuse("there is no input; name at least one file");
  if (io::is_stream(job.output))
    refuse(io::shown_name(job.output, false) +
           ": a cloud that is computed in tiles on disk is written to a file; name one");
  if (job.inputs.size() > 1 && job.output_folder.empty())
    refuse("several inputs need a folder for their results; give --out-dir");
  if (job.output_folder.empty() == job.output.empty()) refuse("give one output: a file, or a folder");
}

// One file by two names would give each of its points twice.
void refuse_same_files(const std::vector<fs::path>& inputs) {
  std::map<platform::FileIdentity, const fs::path*> seen;
  for (const fs::path& input : inputs) {
    const auto identity = platform::identity_of(input);
    if (!identity) continue;  // said when it is opened
    const auto [other, is_new] = seen.try_emplace(*identity, &input);
    if (!is_new)
      refuse(platform::text_of(input) + ": is the same file as the input " + platform::text_of(*other->second) +
             ", so its points would count twice; name it once");
  }
}

std::vector<InputFile> files_of(const TiledJob& job) {
  refuse_same_files(job.inputs);

  std::vector<InputFile> files;
  std::set<fs::path> outputs;
  for (const fs::path& input : job.inputs) {
    if (io::is_stream(input))
      refuse(io::shown_name(input, true) +
             ": a cloud that is computed in tiles on disk is read twice, which this input cannot be; write it to a "
             "file first");
    InputFile file;
    file.path = whole_path(input);
    file.output = whole_path(job.output_folder.empty() ? job.output : job.output_folder / TiledRun::output_name(input));
    if (platform::text_of(file.path).find('\n') != std::string::npos ||
        platform::text_of(file.output).find('\n') != std::string::npos)
      refuse(platform::text_of(input) + ": its name has more than one line; rename it");
    if (!outputs.insert(file.output).second)
      refuse(platform::text_of(input) + ": two inputs have this name, so their results would be one file; rename one");
    std::error_code ignored;
    if (fs::equivalent(file.path, file.output, ignored))
      refuse(platform::text_of(file.output) + ": is input and output at once; name another output");
    files.push_back(std::move(file));
  }
  return files;
}

// All are looked at before one is refused: who mends files one by one runs once for each. Null: the file holds no
// points.
std::vector<std::shared_ptr<Source>> open_all(const std::vector<InputFile>& files, unsigned threads) {
  constexpr std::size_t kMostNames = 5;
  std::vector<std::shared_ptr<Source>> sources;
  std::string refused, others;
  std::size_t count = 0;
  for (const InputFile& file : files) {
    try {
      sources.push_back(io::open_source(file.path, threads));
    } catch (const NoPoints&) {
      if (files.size() == 1) throw;
      sources.emplace_back();
    } catch (const Error& error) {
      if (error.kind() != ErrorKind::file) throw;
      if (count++ == 0) {
        refused = error.what();
      } else if (count <= kMostNames + 1) {
        others += (count > 2 ? ", " : "") + platform::text_of(file.path.filename());
      }
    }
  }
  if (count == 0 && std::ranges::none_of(sources, [](const auto& source) { return source != nullptr; }))
    throw NoPoints(platform::text_of(files.front().path) + ": has no points, nor has another input; name other files");
  if (count == 0) return sources;
  if (count > kMostNames + 1) others += ", ..";
  if (count > 1) refused += "; nor can " + std::to_string(count - 1) + " more of the inputs be read: " + others;
  throw Error(ErrorKind::file, refused);
}

// Does the work; of several inputs, an error names the one that it is about.
template <class Work>
void naming(const Source& source, bool are_several, const Work& work) {
  try {
    work();
  } catch (const Error& error) {
    if (!are_several || std::string_view(error.what()).find(source.name()) != std::string_view::npos) throw;
    throw Error(error.kind(), source.name() + ": " + error.what());
  }
}

// Coordinates in feet and in metres are not those of one cloud, nor are such heights.
class Units {
 public:
  void take(const Source& source) {
    take(source, &FileInfo::metres_per_unit, "its unit", plane_);
    take(source, &FileInfo::metres_per_height, "the unit of its heights", heights_);
  }
  std::optional<double> metres_per_unit() const { return plane_.metres; }

 private:
  // What the first file said that says it.
  struct Said {
    std::optional<double> metres{};
    std::string file{};
  };
  static void take(const Source& source, std::optional<double> FileInfo::*unit, const char* name, Said& first) {
    constexpr double kSame = 1e-3;  // of the unit; feet are of several kinds
    const std::optional<double> its = source.info().*unit;
    if (!its) return;
    if (!first.metres) first = {its, source.name()};
    if (std::abs(*its - *first.metres) <= kSame * *first.metres) return;
    char lengths[2][32];
    std::snprintf(lengths[0], sizeof lengths[0], "%.4g", *its);
    std::snprintf(lengths[1], sizeof lengths[1], "%.4g", *first.metres);
    refuse(source.name() + ": " + name + " is " + lengths[0] + " m, and that of " + first.file + " is " + lengths[1] +
           " m, so that together they are no cloud; convert one of them, or treat every file on its own with run "
           "--each");
  }

  Said plane_, heights_;
};

// A box of positions.
struct Extent : io::BoxOf<double> {
  double diagonal() const { return portable::hypot(max[0] - min[0], max[1] - min[1], max[2] - min[2]); }
  double distance_to(const Extent& other) const {
    double gap[3];
    for (std::size_t axis = 0; axis < 3; ++axis)
      gap[axis] = std::max({0.0, other.min[axis] - max[axis], min[axis] - other.max[axis]});
    return portable::hypot(gap[0], gap[1], gap[2]);
  }
};

// Where coordinates are floats relative to one origin, a file far away, mostly in another coordinate system, would cost
// all files their digits.
void refuse_stray_files(const std::vector<InputFile>& files, const std::vector<Extent>& extents) {
  constexpr double kFar = 10;  // times the size of all others together
  for (std::size_t i = 0; i < extents.size(); ++i) {
    if (extents[i].is_empty()) continue;
    Extent others;
    double nearest = kInfinite;
    for (std::size_t j = 0; j < extents.size(); ++j) {
      if (j == i || extents[j].is_empty()) continue;
      others.add(extents[j]);
      nearest = std::min(nearest, extents[i].distance_to(extents[j]));
    }
    if (others.is_empty() || nearest <= kFar * std::max(others.diagonal(), extents[i].diagonal())) continue;
    char distance[32];
    std::snprintf(distance, sizeof distance, "%.4g", nearest);
    refuse(platform::text_of(files[i].path) + ": lies " + distance +
           " from the other inputs, far more than they are wide: it belongs to another place or has other coordinates; "
           "run it by itself");
  }
}

// The place that is asked for, or that all inputs say.
std::optional<Position> sensor_of(const TiledJob& job, const std::vector<std::shared_ptr<Source>>& sources) {
  if (!job.viewpoint.empty()) return io::named_place(job.viewpoint);
  std::optional<std::optional<Position>> all;
  for (const auto& source : sources) {
    if (!source) continue;
    const std::optional<Position> its = io::common_sensor(*source);
    if (all.value_or(its) != its) return std::nullopt;
    all = its;
  }
  return all.value_or(std::nullopt);
}

// Why the sensor of the job is not one that tiles can take; empty if it is.
std::string why_not_this_sensor(const TiledJob& job, const std::optional<Position>& sensor) {
  if (!job.viewpoint.empty() && job.viewpoint != "none" && !sensor)
    return "--viewpoint " + job.viewpoint + ": a run in tiles on disk takes one place for all points; give x,y,z";
  if (job.params.along == Along::ray && !sensor)
    return "--along ray needs the place of the sensor, which is not known: give --viewpoint x,y,z";
  return {};
}

std::string why_not_written(const TiledJob& job, const Source& source, const fs::path& output) {
  const std::string added = added_outlier_attribute(job.outlier_action, job.params, source);
  const std::string why = io::why_not_streamed(source, output, job.write, added);
  return why.empty() ? why_no_outlier_action(job.outlier_action, source) : why;
}

void refuse_if(const std::string& why) {
  if (!why.empty()) refuse(why);
}

// Positions from all over the inputs, and the zones that they show.
struct Survey {
  Zones zones;
  std::vector<Point> sample;
  std::vector<Extent> extents;  // of what was seen of each file
};

Survey survey(const std::vector<std::shared_ptr<Source>>& sources, std::uint64_t points, double coordinate_step) {
  struct Block {
    std::size_t file, block;
  };
  std::vector<Block> blocks;
  for (std::size_t file = 0; file < sources.size(); ++file)
    for (std::size_t block = 0; sources[file] && block < sources[file]->block_count(); ++block)
      blocks.push_back({file, block});
  const double share = std::min(1.0, double(kSampledPoints) / double(points));
  const auto count = std::max<std::size_t>(1, static_cast<std::size_t>(double(blocks.size()) * share));
  const std::size_t kept_of_block = std::max<std::size_t>(16, kKeptSamples / count);
  std::vector<std::vector<Position>> kept(count);
  const std::uint64_t looked_at = count == blocks.size() ? points : points * count / blocks.size();
  std::vector<io::OriginSample> offered(count, io::OriginSample(looked_at));
  io::for_each_block(count, [&](std::size_t i) {
    const auto [file, block] = blocks[i * blocks.size() / count];
    std::vector<Position> values(sources[file]->block_size(block));
    sources[file]->positions(block, values);
    for (const Position& value : values) offered[i].offer(value);
    const std::size_t step = std::max<std::size_t>(1, values.size() / kept_of_block);
    for (std::size_t at = 0; at < values.size(); at += step) kept[i].push_back(values[at]);
  });
  for (std::size_t i = 1; i < count; ++i) offered[0].offer_all(offered[i]);
  std::vector<Position> shown = std::move(offered[0]).take();
  const Position origin = io::choose_origin(shown);
  Survey result{{origin, zone_side(std::move(shown), looked_at, origin, coordinate_step)},
                {},
                std::vector<Extent>(sources.size())};
  for (std::size_t i = 0; i < count; ++i)
    for (const Position& value : kept[i]) {
      const Point p = offset(value, origin);
      if (!is_indexed(p)) continue;
      result.sample.push_back(p);
      result.extents[blocks[i * blocks.size() / count].file].add(value);
    }
  return result;
}

}  // namespace

std::size_t chunk_of(std::span<const InputChunk> chunks, std::uint64_t point) {
  const auto after = std::ranges::upper_bound(chunks, point, {}, &InputChunk::first_point);
  return std::size_t(after - chunks.begin()) - 1;
}

std::uint64_t bytes_of_chunk(const InputChunk& chunk) { return kProcessBytes + chunk.points * kBytesOfChunkPoint; }

std::string fingerprint_of(const fs::path& path) {
  const auto status = platform::status_of(path);
  if (!status) io::fail(platform::text_of(path), "cannot open: " + platform::message_of(errno));
  const StoredFile file(path);
  const std::uint64_t size = file.size();
  constexpr std::uint64_t kPieces = 64, kBytes = 4096;
  std::uint64_t hash = 0xcbf29ce484222325u;  // FNV-1a (G. Fowler, L. C. Noll, K.-P. Vo)
  std::vector<unsigned char> bytes;
  for (std::uint64_t piece = 0; piece < kPieces; ++piece) {
    bytes.resize(static_cast<std::size_t>(std::min(kBytes, size)));
    file.read((size - bytes.size()) / (kPieces - 1) * piece, std::span(bytes));
    for (const unsigned char byte : bytes) hash = (hash ^ byte) * 0x100000001b3u;
  }
  char text[80];
  std::snprintf(text, sizeof text, "%llx-%llx.%lx-%016llx", static_cast<unsigned long long>(size),
                static_cast<unsigned long long>(status->changed_seconds),
                static_cast<unsigned long>(status->changed_nanoseconds), static_cast<unsigned long long>(hash));
  return text;
}

std::shared_ptr<Source> Inputs::open(std::size_t number) {
  std::shared_ptr<Source>& source = open_[number];
  const InputFile& file = files_[number];
  if (source && file.path.empty()) return source;
  check_unchanged(number);
  if (!source) source = io::open_source(file.path, threads_);
  return source;
}

void Inputs::check_unchanged(std::size_t number) const {
  const InputFile& file = files_[number];
  if (fingerprint_of(file.path) != file.fingerprint)
    io::fail(platform::text_of(file.path),
             "has changed since this run was planned; plan it again in another work folder");
}

// Blocks that follow each other.
void add_chunks(const Source& source, Plan& plan) {
  const std::uint64_t beside = needs_heights(plan.outlier_action) ? HeightGrid::kMostBytes : 0;
  const std::uint64_t most = std::min(kMostOfChunk, points_in_memory(plan.memory - beside, kBytesOfChunkPoint));
  const std::size_t number = plan.files.size() - 1;
  const InputFile& file = plan.files.back();
  InputChunk chunk{number, 0, 0, file.first_point, 0};
  for (std::size_t block = 0; block < source.block_count(); ++block) {
    const std::uint64_t size = source.block_size(block);
    if (size > 4 * most)
      io::fail(platform::text_of(file.path),
               "holds " + std::to_string(size) + " points in one piece that cannot be read in parts; give more memory");
    if (chunk.points > 0 && chunk.points + size > most) {
      plan.chunks.push_back(chunk);
      chunk = {number, block, block, chunk.first_point + chunk.points, 0};
    }
    chunk.end_block = block + 1;
    chunk.points += size;
  }
  if (chunk.points > 0) plan.chunks.push_back(chunk);
}

LeafTree cut_into_tiles(Plan& plan, std::span<Point> sample, std::uint64_t least_tiles) {
  const std::uint64_t tiles = std::max(least_tiles, tiles_on_disk(plan.points, plan.params, plan.memory));
  const std::uint64_t leaves =
      std::clamp(plan.points / kPointsOfLeaf, kLeastLeaves * tiles, std::max(kMostLeaves, kLeastLeaves * tiles));
  LeafTree tree(sample, tiles, leaves / tiles);
  plan.tiles = tree.tiles();
  return tree;
}

int iterations_of(const Params& params) {
  return params.iterations == kAutomatic ? pointfair::resolve(params, {}, 1).params.iterations : params.iterations;
}

bool can_be_planned(const TiledJob& job, const std::shared_ptr<Source>& source) {
  if (io::is_stream(job.output) || !why_not_in_parts(job.params).empty()) return false;
  std::error_code ignored;
  if (fs::equivalent(job.inputs.front(), job.output, ignored)) return false;
  return why_not_this_sensor(job, sensor_of(job, {source})).empty() &&
         why_not_written(job, *source, job.output).empty();
}

void make_plan(const TiledJob& job, const fs::path& work, unsigned threads) {
  check_job(job);
  refuse_if(why_not_in_parts(job.params, !job.output_folder.empty()));
  Plan plan;
  plan.write = job.write;
  plan.limits = job.limits;
  plan.noise_attribute = job.noise_attribute;
  plan.viewpoint = job.viewpoint;
  plan.outlier_action = job.outlier_action;
  plan.coordinate_step = kInfinite;
  plan.memory = memory_of_task(job);
  Units units;
  std::vector<InputFile> files = files_of(job);
  for (InputFile& file : files) {
    if (!job.write.overwrite && fs::exists(file.output))  // rather than after the work
      io::fail(platform::text_of(file.output), "exists already; add --force to replace it");
    file.fingerprint = fingerprint_of(file.path);
  }
  const std::vector<std::shared_ptr<Source>> sources = open_all(files, threads);
  for (std::size_t f = 0; f < files.size(); ++f) {
    InputFile& file = files[f];
    const std::shared_ptr<Source>& source = sources[f];
    file.first_point = plan.points;
    if (!source) {
      io::check_copy_without_points(file.path, file.output, job.write);
      file.notes = {{FileNote::Kind::remark, "the file has no points and was copied"}};
      plan.files.push_back(std::move(file));
      continue;
    }
    Params params;
    naming(*source, files.size() > 1, [&] {
      refuse_if(why_not_written(job, *source, file.output));
      if (job.limits.strength > 0) io::check_not_geographic(*source);
      check_attributes(source, job.limits, job.noise_attribute);
      params = in_file_units(job.params, source->info().metres_per_unit);
    });
    units.take(*source);
    if (plan.points > 0 && params != plan.params)
      refuse(platform::text_of(file.path) +
             ": its unit is not that of the other inputs; give lengths without m, mm or cm");
    plan.params = params;
    plan.coordinate_step = std::min(plan.coordinate_step, coordinate_step(*source));
    // the types of a text are known once all of it was read
    plan.stores_floats |= source->encoding() != Encoding::ascii && source->stores_floats();
    file.coordinate_system = coordinate_system_of(*source);
    file.notes = notes_on(job, source, file);
    file.points = source->size();
    plan.points += file.points;
    plan.files.push_back(std::move(file));
    add_chunks(*source, plan);
  }
  plan.metres_per_unit = units.metres_per_unit();
  if (job.write.strict) refuse_losses(plan);
  plan.sensor = sensor_of(job, sources);
  plan.seeks_sensor = job.viewpoint.empty() && std::ranges::none_of(sources, [](const auto& source) {
                        return source && io::has_sensor(*source);
                      });
  refuse_if(why_not_this_sensor(job, plan.sensor));
  add_notes_on_sensors(sources, plan);
  plan.iterations = iterations_of(plan.params);
  Survey seen = io::with_threads(threads, [&] { return survey(sources, plan.points, plan.coordinate_step); });
  plan.zones = seen.zones;
  if (!plan.zones.are_several()) refuse_stray_files(plan.files, seen.extents);
  const LeafTree tree = cut_into_tiles(plan, seen.sample, job.least_tiles);
  std::error_code failed;
  fs::create_directories(work, failed);
  if (failed) io::fail(platform::text_of(work), "this work folder cannot be made: " + failed.message());
  tree.save(work / kTreeName);
  const std::string text = text_of(plan);
  NewFile file(work / kPlanName, text.size());
  file.write(text.data(), text.size());
  file.finish();
}

void refuse_losses(const Plan& plan) {
  for (const InputFile& file : plan.files) refuse_losses(file.output, file.notes);
}

bool has_plan(const fs::path& work) { return fs::exists(work / kPlanName); }

Plan read_plan(const fs::path& work) {
  const std::string name = platform::text_of(work / kPlanName);
  if (!has_plan(work)) io::fail(name, "there is no plan here; make one with: pointfair tile plan");
  return plan_of(read_text(name), name);
}

std::string difference(const TiledJob& job, const Plan& plan) {
  check_job(job);
  const std::vector<InputFile> files = files_of(job);
  if (!std::ranges::equal(files, plan.files, {}, &InputFile::path, &InputFile::path)) return "other inputs";
  if (!std::ranges::equal(files, plan.files, {}, &InputFile::output, &InputFile::output)) return "other outputs";
  if (job.memory != 0 && memory_of_task(job) != plan.memory) return "another --memory, or for other cards";
  if (job.limits != plan.limits) return "other limits";
  if (job.noise_attribute != plan.noise_attribute) return "another --noise";
  if (job.viewpoint != plan.viewpoint) return "another --viewpoint";
  if (job.outlier_action != plan.outlier_action) return "another --outliers";
  const bool has_metres = in_file_units(job.params, 1.0) != job.params;
  Params params = job.params;
  if (has_metres) {
    const auto first = std::ranges::find_if(plan.files, [](const InputFile& file) { return file.points > 0; });
    params = in_file_units(job.params, io::open_source(first->path, 0)->info().metres_per_unit);
  }
  if (params != plan.params) return "other parameters";
  if (job.write.format != plan.write.format || job.write.encoding != plan.write.encoding ||
      job.write.las_scale != plan.write.las_scale)
    return "another format";
  return {};
}

}  // namespace pointfair::scale
