// SPDX-License-Identifier: Apache-2.0
#include "document.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <mutex>

#include "attributes.hpp"
#include "drawn_faces.hpp"
#include "pointfair/file_info.hpp"
#include "quantise.hpp"
#include "saved_notes.hpp"
#include "texture_message.hpp"

namespace pointfair::viewer {
namespace {

using Clock = std::chrono::steady_clock;
namespace fs = std::filesystem;

constexpr double kSlowMilliseconds = 100;  // a run expected to take longer gets a preview first
constexpr std::chrono::milliseconds kProgressInterval{100};
constexpr std::chrono::milliseconds kHeld{
    200};  // without a newer message before more than a quick preview under a held slider

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

[[noreturn]] void interrupt() { throw Error(ErrorKind::interrupted, "interrupted"); }

// Throws ErrorKind::interrupted if stopped meanwhile.
void wait_for(std::chrono::milliseconds time, const std::stop_token& stop) {
  std::mutex mutex;
  std::unique_lock lock(mutex);
  std::condition_variable_any().wait_for(lock, stop, time, [] { return false; });
  if (stop.stop_requested()) interrupt();
}

std::string shown_path(const fs::path& path) { return fs::absolute(path).lexically_normal().string(); }

void check_size(const Cloud& cloud, const std::string& name, std::uint64_t most_points) {
  if (most_points == 0 || cloud.points.size() <= most_points) return;
  throw Error(ErrorKind::usage,
              fmt::format("{} has {} points and this page takes up to {}: install pointfair, whose viewer and program "
                          "take any number",
                          name, cloud.points.size(), most_points));
}

}  // namespace

Document::Document(Session::Options options, Session::Send send)
    : options_(std::move(options)),
      send_(std::move(send)),
      shading_(options_.make_pipeline),
      preview_(options_.make_pipeline) {}

void Document::open(Cloud cloud, const std::string& name, std::string path, Companions companions) {
  check_not_geographic(cloud);
  check_size(cloud, name, options_.most_points);
  has_cloud_ = false;
  preview_.reset();
  if (!pipeline_) pipeline_.emplace(options_.make_pipeline());
  cloud_ = std::move(cloud);
  companions_ = std::move(companions);
  const std::size_t count = cloud_.points.size();
  pipeline_->load(cloud_);
  const Polygons faces = polygons(cloud_);
  facts_ = {.name = name,
            .path = std::move(path),
            .estimates = pipeline_->estimates(),
            .colours = colour_choices(cloud_),
            .faces = faces.size(),
            .shown = std::min<std::size_t>(count, options_.point_budget)};
  facts_.step = displacement_step(facts_.estimates.spacing, facts_.estimates.diagonal);
  facts_.settles = count <= kMaxShaded;
  notes_on_faces_ = notes_on_faces(faces, count);
  find_texture(faces);
  place_sensor();
  result_ = pipeline_->host_buffer(count);
  normals_ = pipeline_->host_buffer(count);
  order_ = Order(count);
  expectation_.reset(count);
  last_params_ = {};
  limits_ = Limits{};
  movable_.clear();
  without_ignored_.clear();
  motion_.clear();
  start_shading_.clear();
  has_cloud_ = true;
  if (facts_.settles) {
    shading_.compute(cloud_.points, normals_.points(), {});
    start_shading_ = encode_normals(normals_.points(), order_, facts_.shown);
  } else {
    shading_.reset();
  }
}

// Offers the pictures of the faces, where the page draws faces.
void Document::find_texture(const Polygons& faces) {
  texture_ = {};
  if (!are_drawn(faces, cloud_.points.size(), facts_.shown)) return;
  texture_ = texture(cloud_, [this](const std::string& name) { return companions_.read(name); });
  if (texture_.pictures.empty() && texture_.notes.empty()) return;
  facts_.colours.insert(facts_.colours.begin(), Json{{"name", "texture"}, {"kind", "texture"}});
}

void Document::greet() {
  const std::optional<DeviceInfo> device = pipeline_ ? std::optional(pipeline_->device()) : std::nullopt;
  send_(pack(hello_answer(device, options_.saves_to_page ? "" : shown_path(options_.save_folder), has_cloud_)));
  send_cloud();
}

void Document::send_cloud() {
  motion_.clear();  // a new page has none
  if (!has_cloud_) return;
  std::vector<float> positions(3 * facts_.shown);
  for (std::size_t place = 0; place < facts_.shown; ++place) {
    const Point& p = cloud_.points[order_.index(place)];
    positions[3 * place] = p.x;
    positions[3 * place + 1] = p.y;
    positions[3 * place + 2] = p.z;
  }
  const DrawnFaces faces = drawn_faces(polygons(cloud_), order_, facts_.shown);
  send_(pack(cloud_answer(cloud_, facts_),
             {make_array("positions", positions), make_array("normals", start_shading_),
              make_array("face_ends", faces.ends), make_array("face_corners", faces.corners)}));
}

// None where nothing can be measured; the run says itself what is wrong with parameters.
std::optional<Params> Document::resolved(const Params& params, const std::stop_token& stop) {
  try {
    return pipeline_->resolve(params, stop);
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::usage) throw;
    return std::nullopt;
  }
}

void Document::run(const Request& request, std::stop_token stop) {
  if (!has_cloud_) return;
  update_movable(request.recipe.limits);
  const std::optional<Params> used = resolved(request.recipe.params, stop);
  // a part of a mesh has no faces, and the equations of a part are others
  const bool has_parts = used && !needs_whole_cloud(*used);
  if (has_parts && expectation_.milliseconds(*used) > kSlowMilliseconds) show_preview(request, *used, stop);
  pipeline_->run(request.recipe.params, result_.points(), stop, progress_for(request.id));
  last_params_ = request.recipe.params;
  expectation_.learn(pipeline_->report());
  apply_limits(request.recipe.limits, movable_, cloud_.points, result_.points());
  show_result(request, stop);
}

void Document::update_movable(const Limits& limits) {
  if (limits_) {
    Limits same = limits;
    same.strength = limits_->strength;  // which points may move does not depend on it
    if (same == *limits_) return;
  }
  std::vector<std::uint8_t> movable = movable_points(limits, cloud_);
  if (!limits_ || limits.ignore != limits_->ignore) reload(limits);
  movable_ = std::move(movable);
  limits_ = limits;
}

// Gives the pipeline the points that are not ignored.
void Document::reload(const Limits& limits) {
  limits_.reset();  // should this fail, the next run loads again
  without_ignored_.clear();
  motion_.clear();
  preview_.reset();
  if (limits.ignore.empty()) {
    pipeline_->load(cloud_);
  } else {
    Cloud seen = without_ignored(limits, cloud_);
    pipeline_->load(seen);
    without_ignored_ = std::move(seen.points);
  }
  place_sensor();
}

// The viewpoint of the command line. It holds for the cloud that the command line names, not for clouds from the page.
std::string Document::viewpoint() const { return facts_.path.empty() ? std::string() : options_.viewpoint; }

// In the pipeline and in those of the preview.
void Document::place_sensor() {
  std::vector<Position> viewpoints = parse_viewpoints(viewpoint(), cloud_);
  if (!viewpoint().empty()) pipeline_->set_viewpoint(viewpoints);  // else the load took what the file says
  notes_ = notes_on_viewpoints(viewpoints, cloud_.origin, facts_.estimates);
  for (Position& viewpoint : viewpoints)
    for (std::size_t axis = 0; axis < 3; ++axis) viewpoint[axis] -= cloud_.origin[axis];
  preview_.set_viewpoint(std::move(viewpoints));
}

const std::vector<Point>& Document::seen_points() const {
  return without_ignored_.empty() ? cloud_.points : without_ignored_;
}

// The limits upon a part of the cloud.
void Document::limit(const Limits& limits, std::span<Point> after, std::span<const std::uint32_t> indices) const {
  std::vector<Point> before;
  std::vector<std::uint8_t> movable;
  for (const std::uint32_t i : indices) {
    before.push_back(cloud_.points[i]);
    if (!movable_.empty()) movable.push_back(movable_[i]);
  }
  apply_limits(limits, movable, before, after);
}

// Where the user looks, else the middle.
Point Document::focus_of(const Request& request) const {
  const auto& [low, high] = std::pair(facts_.estimates.min, facts_.estimates.max);
  std::array<double, 3> at;
  for (std::size_t axis = 0; axis < 3; ++axis)
    at[axis] = request.focus ? (*request.focus)[axis] - cloud_.origin[axis] : (low[axis] + high[axis]) / 2;
  return {static_cast<float>(at[0]), static_cast<float>(at[1]), static_cast<float>(at[2])};
}

void Document::show_preview(const Request& request, const Params& used, std::stop_token stop) {
  preview_.run(seen_points(), focus_of(request), used, facts_.estimates.spacing, stop,
               [&](const Preview::Result& part) {
                 send_part(request, part);
                 // a page on this machine draws meanwhile, with the same processors
                 if (!request.held || part.more) return;
                 if (!options_.own_thread) interrupt();  // newer parameters are heard after this turn
                 wait_for(kHeld, stop);
               });
}

// Sends the points of a part that the page holds and that have a place after the run.
void Document::send_part(const Request& request, const Preview::Result& part) {
  std::vector<Point> after = part.after;
  limit(request.recipe.limits, after, part.indices);
  std::vector<std::uint32_t> places;
  std::vector<float> moved;
  for (std::size_t i = 0; i < after.size(); ++i) {
    const std::uint32_t place = order_.place(part.indices[i]);
    if (place >= facts_.shown) continue;
    const Point &p = cloud_.points[part.indices[i]], &q = after[i];
    const Point d{q.x - p.x, q.y - p.y, q.z - p.z};
    if (!std::isfinite(d.x + d.y + d.z)) continue;
    places.push_back(place);
    moved.insert(moved.end(), {d.x, d.y, d.z});
  }
  send_(pack({{"type", "preview"},
              {"id", request.id},
              {"center", {part.center.x, part.center.y, part.center.z}},
              {"radius", part.radius},
              {"more", part.more},
              {"ms", part.milliseconds},
              {"server_ms", request.milliseconds_since_received()},
              {"points", places.size()}},
             {make_array("places", places), make_array("displacements", moved)}));
}

// Whether the page needs other normals to decode the last run's displacements. `motion_` then holds the new normals; it
// is empty where points did not move along normals.
bool Document::takes_motion_normals(const Report& report) {
  const bool along_normals = report.params.iterations == 1 && moves_along_normal(report.params.method) &&
                             report.params.along == Along::normal && report.params.outliers != Outliers::move;
  if (!along_normals || first_difference(motion_params_, report.params) <= Stage::normals) motion_.clear();
  if (!along_normals || !motion_.empty()) return false;
  pipeline_->normals(normals_.points());
  motion_ = encode_normals(normals_.points(), order_, facts_.shown);
  motion_params_ = report.params;
  return true;
}

void Document::show_result(const Request& request, const std::stop_token& stop) {
  const Report& report = pipeline_->report();
  const auto start = Clock::now();
  const bool fresh = takes_motion_normals(report);
  const Displacements moved =
      encode_displacements(cloud_.points, result_.points(), order_, facts_.shown, motion_, facts_.step);
  std::vector<Array> arrays{make_array("displacements", moved.values), make_array("places", moved.places),
                            make_array("exceptions", moved.exceptions)};
  if (fresh) arrays.push_back(make_array("motion_normals", motion_));
  const std::vector<std::string> notes = notes_on(request, moved, stop);
  send_(pack(result_answer(request, report, moved, notes, facts_.step, milliseconds_since(start), errand_of(request)),
             arrays));
}

// In the order of the program.
std::vector<std::string> Document::notes_on(const Request& request, const Displacements& moved,
                                            const std::stop_token& stop) {
  const auto& [params, limits] = request.recipe;
  std::vector<std::string> notes = notes_on_run(
      params, pipeline_->estimates(stop), pipeline_->report(), {moved.mean, moved.rms, moved.p95, moved.max},
      stored_float_step(cloud_, facts_.estimates), file_info(cloud_).metres_per_unit);
  notes.insert(notes.end(), notes_.begin(), notes_.end());
  if (viewpoint().empty() && !pipeline_->report().found_sensor) {
    const std::vector<std::string> on_grid = notes_on_grid(cloud_);
    notes.insert(notes.end(), on_grid.begin(), on_grid.end());
  }
  const std::vector<std::string> on_units = notes_on_units(cloud_);
  notes.insert(notes.end(), on_units.begin(), on_units.end());
  if (params.connectivity == Connectivity::automatic && limits.strength > 0)
    notes.insert(notes.end(), notes_on_faces_.begin(), notes_on_faces_.end());
  return notes;
}

void Document::send_shading(std::stop_token stop) {
  if (!has_cloud_ || !facts_.settles) return;
  shading_.compute(result_.points(), normals_.points(), stop);
  const std::vector<std::int16_t> normals = encode_normals(normals_.points(), order_, facts_.shown);
  send_(pack({{"type", "settled"}}, {make_array("normals", normals)}));
}

void Document::send_colours(const Json& id, const std::string& name) {
  if (!has_cloud_) return;
  const Json head{{"type", "colours"}, {"id", id}, {"name", name}};
  if (name == "rgb") {
    send_(pack(head, {make_array("rgb", colours(cloud_, order_, facts_.shown))}));
  } else {
    send_(pack(head, {make_array("scalar", scalars(cloud_, name, order_, facts_.shown))}));
  }
}

void Document::send_texture(const Json& id) {
  if (has_cloud_) send_(texture_message(id, cloud_, texture_, companions_, order_, facts_.shown));
}

void Document::send_noise(const Json& id, std::stop_token stop) {
  if (!has_cloud_) return;
  std::vector<float> of_points(cloud_.points.size()), of_places(facts_.shown);
  pipeline_->noise(of_points, {}, stop);
  for (std::size_t place = 0; place < of_places.size(); ++place) of_places[place] = of_points[order_.index(place)];
  send_(pack({{"type", "colours"}, {"id", id}, {"name", "noise"}}, {make_array("noise", of_places)}));
}

void Document::send_outliers(const Json& id, std::stop_token stop) {
  if (!has_cloud_) return;
  Params marking = last_params_;
  marking.outliers = Outliers::mark;
  std::vector<Point> unused(cloud_.points.size());
  pipeline_->run(marking, unused, stop);
  const std::span<const std::uint8_t> of_points = pipeline_->outliers();
  std::vector<float> of_places(facts_.shown);
  for (std::size_t place = 0; place < of_places.size(); ++place) {
    const std::uint32_t i = order_.index(place);
    of_places[place] = movable_.empty() || movable_[i] ? of_points[i] : 0;
  }
  send_(pack({{"type", "colours"}, {"id", id}, {"name", "outliers"}}, {make_array("outliers", of_places)}));
}

void Document::send_cancelled(const Json& id, double milliseconds) {
  send_(pack({{"type", "cancelled"}, {"id", id}, {"ms", milliseconds}}));
}

ProgressFunction Document::progress_for(const Json& id) const {
  return [this, id, last = Clock::now()](double share, std::string_view stage) mutable {
    if (Clock::now() - last < kProgressInterval) return;
    last = Clock::now();
    send_(pack(progress_answer(id, share, stage)));
  };
}

Errand Document::errand_of(const Request& request) const {
  return {facts_.path.empty() ? facts_.name : facts_.path,
          request.output.empty() ? "denoised.ply" : request.output,
          request.encoding,
          pipeline_->device().kind,
          viewpoint(),
          facts_.path.empty() ? ReadOptions{} : options_.reading};
}

void Document::save(const Request& request, bool overwrite, std::stop_token stop) {
  try {
    write_file(request, {.encoding = encoding_of(request.encoding), .overwrite = overwrite}, stop);
  } catch (const Error& error) {
    send_error(request.id, error.kind() == ErrorKind::interrupted ? "saving was cancelled" : error.what());
  }
}

void Document::write_file(const Request& request, const WriteOptions& write_options, std::stop_token stop) {
  if (!has_cloud_) throw Error(ErrorKind::usage, "there is no cloud to save");
  check_file_name(request.output);
  const fs::path path = options_.save_folder / request.output;
  if (!options_.saves_to_page && fs::is_symlink(path))
    throw Error(ErrorKind::file, request.output + " is a link; choose another name");
  if (!options_.saves_to_page && !write_options.overwrite && fs::exists(path))
    throw Error(ErrorKind::file, request.output +
                                     " exists already; choose another name, or turn on 'Replace a file of "
                                     "that name'");
  update_movable(request.recipe.limits);
  Cloud denoised = pipeline_->run(request.recipe.params, stop, progress_for(request.id));
  apply_limits(request.recipe.limits, cloud_, denoised);
  const Format format = format_to_write(path, file_info(denoised).format);
  Json saved{{"type", "saved"},
             {"id", request.id},
             {"notes", notes_on_file(cloud_, denoised, format, write_options.encoding, facts_.path, path)},
             {"command", as_command(request.recipe, errand_of(request))}};
  if (options_.saves_to_page) {
    const std::vector<std::byte> bytes = write_bytes(denoised, format, write_options.encoding);
    saved["path"] = request.output;
    saved["bytes"] = bytes.size();
    send_(pack(std::move(saved), {{"file", kTypeName<std::uint8_t>, bytes.size(), bytes}}));
  } else {
    write(path, denoised, write_options);
    saved["path"] = shown_path(path);
    saved["bytes"] = fs::file_size(path);
    send_(pack(std::move(saved)));
  }
}

}  // namespace pointfair::viewer
