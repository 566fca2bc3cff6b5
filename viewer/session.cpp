// SPDX-License-Identifier: Apache-2.0
#include "session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <new>
#include <optional>
#include <stop_token>
#include <thread>

#include "attributes.hpp"
#include "expectation.hpp"
#include "order.hpp"
#include "preview.hpp"
#include "quantise.hpp"
#include "recipe.hpp"

namespace pointfair::viewer {
namespace {

using Clock = std::chrono::steady_clock;
namespace fs = std::filesystem;

constexpr int kProtocol = 1;
constexpr double kSlowMilliseconds = 100;  // a run expected to take longer gets a preview first
constexpr int kLookNeighbors = 12;         // of the normals that a cloud is shaded with
constexpr std::size_t kMaxNameLength = 200;
constexpr std::size_t kMaxWaitingJobs = 64;
constexpr std::chrono::milliseconds kProgressInterval{100};
constexpr std::chrono::milliseconds kRest{200};  // without a message before a result is settled

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

// A run that the page asked for.
struct Request {
  Json id;  // returned as it came
  Recipe recipe;
  std::optional<std::array<double, 3>> focus;  // where the user looks, file coordinates
  std::string output, encoding;                // of the file that its command writes
  Clock::time_point received;
  std::uint64_t page = 0;  // which of the pages, one after the other
};

std::string_view device_word(Device::Kind kind) { return kind == Device::cuda ? "cuda" : "cpu"; }

Json device_json(const DeviceInfo& device) {
  return {{"kind", device_word(device.kind)}, {"name", device.name}, {"reason", device.reason}};
}

Json stages_json(const std::vector<StageTime>& stages) {
  Json json = Json::array();
  for (const StageTime& stage : stages) json.push_back({{"name", stage.name}, {"ms", stage.milliseconds}});
  return json;
}

Json formats_json() {
  Json formats = Json::array(), encodings = Json::array();
  for (const char* extension : {"ply", "pcd", "xyz", "txt", "csv", "pts", "off", "obj"}) {
    if (format_of(std::string("x.") + extension)) formats.push_back(extension);
  }
  for (const auto& [name, encoding] : kEncodings) encodings.push_back(name);
  return {{"extensions", formats}, {"encodings", encodings}};
}

std::optional<std::array<double, 3>> focus_of(const Json& json) {
  const auto found = json.find("focus");
  if (found == json.end() || !found->is_array() || found->size() != 3) return std::nullopt;
  std::array<double, 3> focus{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!(*found)[axis].is_number()) return std::nullopt;
    focus[axis] = (*found)[axis].get<double>();
  }
  return focus;
}

std::string string_in(const Json& json, const char* key) {
  const auto found = json.find(key);
  return found != json.end() && found->is_string() ? found->get<std::string>() : std::string();
}

// A name in the folder itself: nothing that leads elsewhere, is hidden, or cannot be typed.
void check_file_name(const std::string& name) {
  const bool plain = !name.empty() && name.size() <= kMaxNameLength && name[0] != '.' && name[0] != '-' &&
                     std::none_of(name.begin(), name.end(), [](char c) {
                       return c == '/' || c == '\\' || static_cast<unsigned char>(c) < 0x20 || c == 0x7f;
                     });
  if (!plain)
    throw Error(ErrorKind::usage, "give a plain file name, such as fair.ply: it is saved in the folder shown");
  if (!format_of(name)) throw Error(ErrorKind::usage, name + ": its extension names no format that can be written");
}

// A request or a save, as the page writes both.
Request read_request(const Json& message, Clock::time_point received) {
  Request request;
  request.id = message.value("id", Json());
  request.recipe = read_recipe(message);
  request.focus = focus_of(message);
  request.output = string_in(message, "output");
  request.encoding = string_in(message, "encoding");
  request.received = received;
  encoding_of(request.encoding);
  return request;
}

Point relative(const std::array<double, 3>& position, const Cloud& cloud) {
  return {static_cast<float>(position[0] - cloud.origin[0]), static_cast<float>(position[1] - cloud.origin[1]),
          static_cast<float>(position[2] - cloud.origin[2])};
}

}  // namespace

// Only the worker's thread touches what stands below `mutex_`'s group of members.
class Session::Worker {
 public:
  using Job = std::function<void(std::stop_token)>;

  Worker(Options options, Send send)
      : options_(std::move(options)),
        send_(std::move(send)),
        preview_(options_.make_pipeline),
        thread_([this] { work(); }) {}

  ~Worker() {
    {
      const std::lock_guard lock(mutex_);
      quit_ = true;
      stop_.request_stop();
    }
    changed_.notify_all();
    thread_.join();
  }

  // The newest parameters win: they take the one place there is, and stop what runs.
  void submit(Request request) {
    const std::lock_guard lock(mutex_);
    request.page = page_;
    waiting_ = std::move(request);
    if (running_) stop_.request_stop();
    changed_.notify_all();
  }

  // A job is done before anything else. It stops a run, which goes on afterwards where it was.
  void post(Job job) {
    const std::lock_guard lock(mutex_);
    if (jobs_.size() >= kMaxWaitingJobs) return;  // a page never asks for so much at once
    jobs_.push_back(std::move(job));
    if (running_) stop_.request_stop();
    changed_.notify_all();
  }

  // What a former page asked for is void.
  void forget_requests() {
    const std::lock_guard lock(mutex_);
    ++page_;
    waiting_.reset();
    if (running_) stop_.request_stop();
  }

  void cancel(const Json& id, Clock::time_point received) {
    {
      const std::lock_guard lock(mutex_);
      waiting_.reset();
      cancelled_ = true;
      stop_.request_stop();
    }
    post([this, id, received](std::stop_token) {
      send_(pack({{"type", "cancelled"}, {"id", id}, {"ms", milliseconds_since(received)}}));
    });
  }

  void send_error(const Json& id, std::string_view message) {
    send_(pack({{"type", "error"}, {"id", id}, {"message", message}}));
  }

  void open(Cloud cloud, const std::string& name, std::string path);
  void greet();
  void save(const Request& request, bool overwrite, std::stop_token stop);
  void send_colours(const Json& id, const std::string& name);

 private:
  void work();
  void do_job(const Job& job, const std::stop_token& stop);
  void do_run(Request request, const std::stop_token& stop);
  void run(const Request& request, const std::stop_token& stop);
  void show_preview(const Request& request, const Params& used, const std::stop_token& stop);
  void show_result(const Request& request);
  void settle(const std::stop_token& stop);
  void send_cloud();
  void measure(const std::stop_token& stop);
  void look_at(std::span<const Point> points, const std::stop_token& stop);
  void update_movable(const Limits& limits);
  void limit(const Limits& limits, std::span<Point> after, std::span<const std::uint32_t> indices);
  ProgressFunction progress_for(const Json& id);
  Errand errand_of(const Request& request) const;
  bool is_replaced() {
    const std::lock_guard lock(mutex_);
    return waiting_.has_value() || quit_;
  }
  bool fits_settling() const { return cloud_.points.size() <= kMaxSettled; }

  const Options options_;
  const Send send_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Request> waiting_;
  std::deque<Job> jobs_;
  std::stop_source stop_;
  std::uint64_t page_ = 0;
  bool running_ = false, cancelled_ = false, quit_ = false;

  bool has_cloud_ = false;
  Cloud cloud_;
  std::string name_, path_;  // the path is empty for a cloud that came through the page
  std::optional<Pipeline> pipeline_, look_;
  Preview preview_;
  Expectation expectation_;
  Estimates estimates_;
  Order order_;
  std::size_t shown_ = 0;  // places that the page holds
  float step_ = 1;
  HostBuffer result_, normals_;           // of all points
  std::vector<std::int16_t> start_look_;  // normals that the cloud as loaded is shaded with
  std::vector<std::int16_t> motion_;      // normals that the page has for displacements along them; empty if none
  Params motion_params_;                  // that they came from
  Limits limits_;                         // of movable_
  std::vector<std::uint8_t> movable_;
  bool settled_ = true;
  Clock::time_point rest_{};  // when to settle

  std::thread thread_;  // last: starts when all else is there
};

void Session::Worker::work() {
  std::unique_lock lock(mutex_);
  while (!quit_) {
    if (jobs_.empty() && !waiting_) {
      if (settled_) {
        changed_.wait(lock);
        continue;
      }
      if (changed_.wait_until(lock, rest_) == std::cv_status::no_timeout) continue;
    }
    stop_ = std::stop_source();
    const std::stop_token stop = stop_.get_token();
    cancelled_ = false;
    if (!jobs_.empty()) {
      const Job job = std::move(jobs_.front());
      jobs_.pop_front();
      lock.unlock();
      do_job(job, stop);
    } else if (waiting_) {
      Request request = std::move(*waiting_);
      waiting_.reset();
      running_ = true;
      lock.unlock();
      do_run(std::move(request), stop);
    } else {
      running_ = true;
      lock.unlock();
      do_job([this](std::stop_token token) { settle(token); }, stop);
    }
    lock.lock();
    running_ = false;
  }
}

void Session::Worker::do_job(const Job& job, const std::stop_token& stop) {
  try {
    job(stop);
  } catch (const std::bad_alloc&) {
    send_error(nullptr, "out of memory; close other programs or take fewer points");
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::interrupted) send_error(nullptr, error.what());
  } catch (const std::exception& error) {
    send_error(nullptr, error.what());
  }
}

void Session::Worker::do_run(Request request, const std::stop_token& stop) {
  try {
    if (has_cloud_) run(request, stop);
  } catch (const std::bad_alloc&) {
    send_error(request.id, "out of memory; close other programs, or take a smaller neighbourhood");
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::interrupted) return send_error(request.id, error.what());
    // a job came between: the run goes on after it, unless newer parameters are there
    const std::lock_guard lock(mutex_);
    if (!waiting_ && !cancelled_ && request.page == page_) waiting_ = std::move(request);
  } catch (const std::exception& error) {
    send_error(request.id, error.what());
  }
}

ProgressFunction Session::Worker::progress_for(const Json& id) {
  return [this, id, last = Clock::now()](double share, std::string_view stage) mutable {
    if (Clock::now() - last < kProgressInterval) return;
    last = Clock::now();
    send_(pack({{"type", "progress"}, {"id", id}, {"share", share}, {"stage", stage}}));
  };
}

void Session::Worker::run(const Request& request, const std::stop_token& stop) {
  settled_ = true;  // what an older run left to do is void
  const Params used = pipeline_->resolve(request.recipe.params, stop);
  update_movable(request.recipe.limits);
  if (expectation_.milliseconds(used) > kSlowMilliseconds) show_preview(request, used, stop);
  pipeline_->run(request.recipe.params, result_.points(), stop, progress_for(request.id));
  expectation_.learn(pipeline_->report());
  apply_limits(request.recipe.limits, movable_, cloud_.points, result_.points());
  show_result(request);
  settled_ = false;
  rest_ = Clock::now() + kRest;
}

void Session::Worker::update_movable(const Limits& limits) {
  if (limits.box == limits_.box && limits.lasso == limits_.lasso) return;
  movable_ = movable_points(limits, cloud_);
  limits_ = limits;
}

// The limits upon a part of the cloud.
void Session::Worker::limit(const Limits& limits, std::span<Point> after, std::span<const std::uint32_t> indices) {
  std::vector<Point> before;
  std::vector<std::uint8_t> movable;
  for (const std::uint32_t i : indices) {
    before.push_back(cloud_.points[i]);
    if (!movable_.empty()) movable.push_back(movable_[i]);
  }
  apply_limits(limits, movable, before, after);
}

void Session::Worker::show_preview(const Request& request, const Params& used, const std::stop_token& stop) {
  Point center{};
  if (request.focus) {
    center = relative(*request.focus, cloud_);
  } else {
    for (auto [axis, a] : {std::pair{&Point::x, 0}, {&Point::y, 1}, {&Point::z, 2}})
      center.*axis = static_cast<float>((estimates_.min[a] + estimates_.max[a]) / 2);
  }
  preview_.run(cloud_.points, center, used, estimates_.spacing, stop, [&](const Preview::Result& part) {
    std::vector<Point> after = part.after;
    limit(request.recipe.limits, after, part.indices);
    std::vector<std::uint32_t> places;
    std::vector<float> moved;
    for (std::size_t i = 0; i < after.size(); ++i) {
      const std::uint32_t place = order_.place(part.indices[i]);
      if (place >= shown_) continue;
      const Point &p = cloud_.points[part.indices[i]], &q = after[i];
      const Point d{q.x - p.x, q.y - p.y, q.z - p.z};
      if (!std::isfinite(d.x + d.y + d.z)) continue;
      places.push_back(place);
      moved.insert(moved.end(), {d.x, d.y, d.z});
    }
    send_(pack({{"type", "preview"},
                {"id", request.id},
                {"ms", part.milliseconds},
                {"server_ms", milliseconds_since(request.received)},
                {"points", places.size()}},
               {make_array("places", places), make_array("displacements", moved)}));
  });
}

void Session::Worker::show_result(const Request& request) {
  const Report& report = pipeline_->report();
  const auto start = Clock::now();
  const bool along_normals =
      report.params.passes == 1 && moves_along_normal(report.params.method) && report.params.outliers != Outliers::move;
  if (!along_normals || first_difference(motion_params_, report.params) <= Stage::normals) motion_.clear();
  const bool fresh = along_normals && motion_.empty();
  if (fresh) {
    pipeline_->normals(normals_.points());
    motion_ = encode_normals(normals_.points(), order_, shown_);
    motion_params_ = report.params;
  }
  const Displacements moved = encode_displacements(cloud_.points, result_.points(), order_, shown_, motion_, step_);
  std::vector<Array> arrays{make_array("displacements", moved.values), make_array("places", moved.places),
                            make_array("exceptions", moved.exceptions)};
  if (fresh) arrays.push_back(make_array("motion_normals", motion_));
  send_(pack({{"type", "result"},
              {"id", request.id},
              {"along_normals", moved.along_normals},
              {"step", step_},
              {"used", params_texts(report.params)},
              {"moved", {{"mean", moved.mean}, {"rms", moved.rms}, {"max", moved.max}}},
              {"unmoved", report.unmoved.non_finite + report.unmoved.too_few_neighbors + report.unmoved.no_normal +
                              report.unmoved.outliers},
              {"stages", stages_json(report.stages)},
              {"total_ms", report.total_milliseconds},
              {"encode_ms", milliseconds_since(start)},
              {"server_ms", milliseconds_since(request.received)},
              {"peak_bytes", {{"host", report.peak_host_bytes}, {"device", report.peak_device_bytes}}},
              {"command", as_command(request.recipe, errand_of(request))},
              {"cpp", as_cpp(request.recipe, errand_of(request))}},
             arrays));
}

// Normals of a cloud from few neighbours, whatever the parameters are, so that what is rough looks rough; `normals_`
// then holds them.
void Session::Worker::look_at(std::span<const Point> points, const std::stop_token& stop) {
  if (!look_) look_.emplace(options_.make_pipeline());
  look_->load(points);
  Params params;
  params.k = kLookNeighbors;
  params.passes = 1;
  look_->run(params, normals_.points(), stop);  // where points go is not asked for
  look_->normals(normals_.points());
}

// What can wait until the hand rests: normals of the result and the noise that is left.
void Session::Worker::settle(const std::stop_token& stop) {
  settled_ = true;
  if (!has_cloud_ || !fits_settling()) return;
  try {
    look_at(result_.points(), stop);
    const double noise = look_->estimates(stop).noise;
    const std::vector<std::int16_t> normals = encode_normals(normals_.points(), order_, shown_);
    send_(pack({{"type", "settled"}, {"noise", noise}}, {make_array("normals", normals)}));
  } catch (const Error& error) {
    if (error.kind() != ErrorKind::interrupted) throw;
    settled_ = is_replaced();  // a job came between: later
  }
}

void Session::Worker::open(Cloud cloud, const std::string& name, std::string path) {
  has_cloud_ = false;
  settled_ = true;
  preview_.reset();
  if (!pipeline_) pipeline_.emplace(options_.make_pipeline());
  cloud_ = std::move(cloud);
  name_ = name;
  path_ = std::move(path);
  pipeline_->load(cloud_);
  estimates_ = pipeline_->estimates();
  result_ = pipeline_->host_buffer(cloud_.points.size());
  normals_ = pipeline_->host_buffer(cloud_.points.size());
  order_ = Order(cloud_.points.size());
  shown_ = static_cast<std::size_t>(std::min<std::uint64_t>(cloud_.points.size(), options_.point_budget));
  step_ = displacement_step(estimates_.spacing, estimates_.diagonal);
  expectation_.reset(cloud_.points.size());
  limits_ = {};
  movable_.clear();
  motion_.clear();
  start_look_.clear();
  has_cloud_ = true;
  if (fits_settling()) {
    look_at(cloud_.points, {});
    start_look_ = encode_normals(normals_.points(), order_, shown_);
  } else {
    look_.reset();
  }
}

void Session::Worker::greet() {
  const std::optional<DeviceInfo> device = pipeline_ ? std::optional(pipeline_->device()) : std::nullopt;
  send_(pack({{"type", "hello"},
              {"protocol", kProtocol},
              {"version", version()},
              {"device", device ? device_json(*device) : Json()},
              {"params", describe_params()},
              {"presets", Json::array({{{"name", "automatic"}, {"params", params_texts({})}},
                                       {{"name", "paper"}, {"params", params_texts(paper_preset())}}})},
              {"limits", kLimitNames},
              {"formats", formats_json()},
              {"save_folder", fs::absolute(options_.save_folder).lexically_normal().string()}}));
  send_cloud();
}

void Session::Worker::send_cloud() {
  motion_.clear();  // a new page has none
  if (!has_cloud_) return;
  std::vector<float> positions(3 * shown_);
  for (std::size_t place = 0; place < shown_; ++place) {
    const Point& p = cloud_.points[order_.index(place)];
    positions[3 * place] = p.x;
    positions[3 * place + 1] = p.y;
    positions[3 * place + 2] = p.z;
  }
  send_(pack({{"type", "cloud"},
              {"name", name_},
              {"path", path_},
              {"points", estimates_.points},
              {"finite", estimates_.finite},
              {"shown", shown_},
              {"origin", cloud_.origin},
              {"min", estimates_.min},
              {"max", estimates_.max},
              {"diagonal", estimates_.diagonal},
              {"spacing", estimates_.spacing},
              {"noise", estimates_.noise},
              {"step", step_},
              {"colours", colour_choices(cloud_)},
              {"settles", fits_settling()}},
             {make_array("positions", positions), make_array("normals", start_look_)}));
}

void Session::Worker::send_colours(const Json& id, const std::string& name) {
  if (!has_cloud_) return;
  const Json head{{"type", "colours"}, {"id", id}, {"name", name}};
  if (name == "rgb") {
    send_(pack(head, {make_array("rgb", colours(cloud_, order_, shown_))}));
  } else {
    send_(pack(head, {make_array("scalar", scalars(cloud_, name, order_, shown_))}));
  }
}

Errand Session::Worker::errand_of(const Request& request) const {
  return {path_.empty() ? name_ : path_, request.output.empty() ? "fair.ply" : request.output, request.encoding,
          pipeline_->device().kind};
}

// The library's own run and write, so that the file is what the command writes.
void Session::Worker::save(const Request& request, bool overwrite, std::stop_token stop) {
  try {
    if (!has_cloud_) throw Error(ErrorKind::usage, "there is no cloud to save");
    check_file_name(request.output);
    const fs::path path = options_.save_folder / request.output;
    if (fs::is_symlink(path)) throw Error(ErrorKind::file, request.output + " is a link; choose another name");
    WriteOptions options;
    options.encoding = encoding_of(request.encoding);
    options.overwrite = overwrite;
    Cloud fair = pipeline_->run(request.recipe.params, stop, progress_for(request.id));
    apply_limits(request.recipe.limits, cloud_, fair);
    write(path, fair, options);
    send_(pack({{"type", "saved"},
                {"id", request.id},
                {"path", fs::absolute(path).lexically_normal().string()},
                {"bytes", fs::file_size(path)},
                {"command", as_command(request.recipe, errand_of(request))}}));
  } catch (const Error& error) {
    send_error(request.id, error.kind() == ErrorKind::interrupted ? "saving was cancelled" : error.what());
  }
}

Session::Session(Options options, Send send) : worker_(std::make_unique<Worker>(std::move(options), std::move(send))) {}
Session::~Session() = default;

void Session::open(Cloud cloud, const std::filesystem::path& path) {
  const auto shared = std::make_shared<Cloud>(std::move(cloud));
  worker_->post([worker = worker_.get(), shared, path](std::stop_token) {
    worker->open(std::move(*shared), path.filename().string(), fs::absolute(path).lexically_normal().string());
  });
}

void Session::open(std::string bytes, std::string name) {
  const auto shared = std::make_shared<std::string>(std::move(bytes));
  worker_->post([worker = worker_.get(), shared, name](std::stop_token) {
    Cloud cloud = read(std::as_bytes(std::span(*shared)), name);
    worker->open(std::move(cloud), name, "");
    worker->greet();
  });
}

void Session::greet() {
  worker_->forget_requests();
  worker_->post([worker = worker_.get()](std::stop_token) { worker->greet(); });
}

void Session::receive(std::string_view text) {
  const auto received = Clock::now();
  Worker* const worker = worker_.get();
  const auto refuse = [worker](const Json& id, std::string what) {
    worker->post([worker, id, what = std::move(what)](std::stop_token) { worker->send_error(id, what); });
  };
  Json id;
  try {
    const Json message = Json::parse(text);
    if (!message.is_object()) return refuse(id, "a message is a JSON object");
    id = message.value("id", Json());
    const std::string type = string_in(message, "type");
    if (type == "run") {
      worker->submit(read_request(message, received));
    } else if (type == "cancel") {
      worker->cancel(id, received);
    } else if (type == "colours") {
      worker->post(
          [worker, id, name = string_in(message, "name")](std::stop_token) { worker->send_colours(id, name); });
    } else if (type == "save") {
      const bool overwrite = message.contains("overwrite") && message["overwrite"] == true;
      worker->post([worker, overwrite, request = read_request(message, received)](std::stop_token stop) {
        worker->save(request, overwrite, stop);
      });
    } else {
      refuse(id, "unknown type of message");
    }
  } catch (const Json::exception&) {
    refuse(id, "the message is not JSON");
  } catch (const Error& error) {
    refuse(id, error.what());
  }
}

}  // namespace pointfair::viewer
