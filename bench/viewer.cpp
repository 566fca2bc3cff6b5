// SPDX-License-Identifier: Apache-2.0
// bench_viewer [--points N] [--k K] [--repeat R] [--cancels C] [--device auto|cpu|cuda] [--program pointfair]: times
// the viewer as its page meets it. Starts `pointfair view` on a noisy torus, connects over loopback as a page does,
// sends slider moves, and prints one JSON object: milliseconds from a message's first byte out to its whole answer in,
// the median of R and the best; and how long C cancelled runs went on, with the processor time that the program spent
// meanwhile, which says how much of a wait is other programs'.
#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <boost/asio/connect.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "pointfair/pointfair.hpp"

extern char** environ;

namespace {

namespace beast = boost::beast;
namespace websocket = beast::websocket;
using boost::asio::ip::tcp;
using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;

struct Options {
  int points = 1'000'000, k = 16, repeat = 11, cancels = 60;
  std::string device = "auto", program = "pointfair";
};

double milliseconds(Clock::duration duration) { return std::chrono::duration<double, std::milli>(duration).count(); }

// Of tube radius 0.35 about a circle of radius 1, with noise of 0.4 of the spacing, in random order.
pointfair::Cloud noisy_torus(int count) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> angle(0, 2 * std::numbers::pi);
  const double area = 4 * std::numbers::pi * std::numbers::pi * 0.35, spacing = std::sqrt(area / count);
  std::normal_distribution<double> noise(0, 0.4 * spacing);
  pointfair::Cloud cloud;
  while (std::ssize(cloud.points) < count) {
    const double u = angle(random), v = angle(random), r = 0.35 + noise(random), ring = 1 + r * std::cos(v);
    if (std::uniform_real_distribution<double>(0, 1.35)(random) > 1 + 0.35 * std::cos(v))
      continue;  // even on the surface
    cloud.points.push_back({float(ring * std::cos(u)), float(ring * std::sin(u)), float(r * std::sin(v))});
  }
  return cloud;
}

// `pointfair view` as a child, until this goes.
class Program {
 public:
  Program(const Options& options, const std::string& cloud) {
    int ends[2];
    if (pipe(ends) != 0) throw std::runtime_error("no pipe");
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], 1);
    posix_spawn_file_actions_addclose(&actions, ends[0]);
    std::vector<std::string> words{options.program, "view", cloud,      "--no-open",
                                   "--port",        "0",    "--device", options.device};
    std::vector<char*> pointers;
    for (std::string& word : words) pointers.push_back(word.data());
    pointers.push_back(nullptr);
    if (posix_spawnp(&child_, words[0].c_str(), &actions, nullptr, pointers.data(), environ) != 0)
      throw std::runtime_error(options.program + " cannot be started; give --program");
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    char byte = 0;
    while (read(ends[0], &byte, 1) == 1 && byte != '\n') url_ += byte;
    close(ends[0]);
    if (!url_.starts_with("http://")) throw std::runtime_error(options.program + " did not say where it listens");
  }
  ~Program() {
    kill(child_, SIGTERM);
    waitpid(child_, nullptr, 0);
  }
  // Processor time of all its threads so far, by the kernel's own nanoseconds.
  double processor_milliseconds() const {
    double nanoseconds = 0;
    for (const auto& thread : std::filesystem::directory_iterator("/proc/" + std::to_string(child_) + "/task")) {
      double its = 0;
      std::ifstream(thread.path() / "schedstat") >> its;
      nanoseconds += its;
    }
    return nanoseconds * 1e-6;
  }
  std::string port() const { return url_.substr(url_.rfind(':') + 1, url_.rfind('/') - url_.rfind(':') - 1); }

 private:
  pid_t child_ = 0;
  std::string url_;
};

// A page without a picture.
class Page {
 public:
  explicit Page(const std::string& port) : socket_(context_) {
    tcp::resolver resolver(context_);
    boost::asio::connect(beast::get_lowest_layer(socket_), resolver.resolve("127.0.0.1", port));
    beast::get_lowest_layer(socket_).set_option(tcp::no_delay(true));
    const std::string host = "127.0.0.1:" + port;
    socket_.set_option(websocket::stream_base::decorator(
        [host](websocket::request_type& request) { request.set(beast::http::field::origin, "http://" + host); }));
    socket_.read_message_max(std::uint64_t{4} << 30);
    socket_.handshake(host, "/session");
    socket_.text(true);
    buffer_.reserve(64 << 20);
  }
  void send(const Json& message) { socket_.write(boost::asio::buffer(message.dump())); }

  // The head of the next message of one of the types; `bytes` is the whole message's size.
  Json next(const std::vector<std::string>& types) {
    while (true) {
      buffer_.clear();
      socket_.read(buffer_);
      bytes = buffer_.size();
      std::uint32_t length = 0;
      const char* data = static_cast<const char*>(buffer_.data().data());
      std::memcpy(&length, data, sizeof length);
      Json head = Json::parse(data + sizeof length, data + sizeof length + length);
      const std::string type = head["type"];
      if (type == "error") throw std::runtime_error(head["message"].get<std::string>());
      if (std::find(types.begin(), types.end(), type) != types.end()) return head;
    }
  }
  // Reads what comes until then, as a page does all the time.
  void read_until(Clock::time_point end) {
    while (Clock::now() < end) {
      if (beast::get_lowest_layer(socket_).available() > 0) {
        buffer_.clear();
        socket_.read(buffer_);
      } else {
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
      }
    }
  }
  std::size_t bytes = 0;

 private:
  boost::asio::io_context context_;
  websocket::stream<tcp::socket> socket_;
  beast::flat_buffer buffer_;
};

struct Sample {
  std::vector<double> values;
  std::size_t bytes = 0;
  Json summary() {
    std::sort(values.begin(), values.end());
    Json json{{"median_ms", values[values.size() / 2]}, {"best_ms", values.front()}, {"worst_ms", values.back()}};
    if (bytes > 0) json["bytes"] = bytes;
    return json;
  }
};

class Bench {
 public:
  Bench(const Program& program, Page& page, const Options& options)
      : program_(program), page_(page), options_(options) {
    base_ = {{"k", std::to_string(options.k)}, {"iterations", "1"}};
  }

  // Alternates between values of a parameter; every answer is a whole result. `between` runs before each and is not
  // timed.
  Json slider(const std::string& name, const std::vector<std::string>& values, const Json& between = nullptr) {
    Sample whole, preview, pipeline, encoding;
    std::map<std::string, Sample> stages;
    int previews = 0;
    run(base_);
    for (int i = 0; i < options_.repeat; ++i) {
      Json params = base_;
      params[name] = values[std::size_t(i) % values.size()];
      if (!between.is_null()) run(between);
      const auto start = Clock::now();
      page_.send(message(params));
      Json head;
      bool first = true;
      do {
        head = page_.next({"result", "preview"});
        const double spent = milliseconds(Clock::now() - start);
        if (head["type"] == "preview" && std::exchange(first, false)) {
          preview.values.push_back(spent);
          ++previews;
        }
      } while (head["type"] != "result");
      whole.values.push_back(milliseconds(Clock::now() - start));
      whole.bytes = page_.bytes;
      pipeline.values.push_back(head["total_ms"]);
      encoding.values.push_back(head["encode_ms"]);
      for (const Json& stage : head["stages"]) stages[stage["name"]].values.push_back(stage["ms"]);
    }
    Json json = whole.summary();
    json["pipeline_ms"] = pipeline.summary()["median_ms"];
    json["encode_ms"] = encoding.summary()["median_ms"];
    for (auto& [stage, sample] : stages) json["stages_ms"][stage] = sample.summary()["median_ms"];
    if (previews > 0) json["preview"] = preview.summary();
    return json;
  }

  // From the message to the word that the run has ended, at any moment of its first 0.6 s: previews, every stage of
  // lists and of radius neighbourhoods, first and further iterations.
  Json cancel() {
    std::mt19937 random(1);
    Sample wait, inside, processor;
    for (int i = 0; i < options_.cancels; ++i) {
      Json params = base_;
      params["k"] = i % 2 == 0 ? std::to_string(60 + i % 16) : "auto";
      params["radius"] = i % 2 == 0 ? "auto" : std::to_string(4 + i % 16) + "s";
      params["iterations"] = "20";
      page_.send(message(params));
      page_.read_until(Clock::now() + std::chrono::milliseconds(random() % 600));
      const double spent = program_.processor_milliseconds();
      const auto start = Clock::now();
      page_.send({{"type", "cancel"}, {"id", ++id_}});
      inside.values.push_back(page_.next({"cancelled"})["ms"]);
      wait.values.push_back(milliseconds(Clock::now() - start));
      processor.values.push_back(program_.processor_milliseconds() - spent);
    }
    Json json = wait.summary();
    json["inside"] = inside.summary();  // by the program's own clock
    json["processor"] = processor.summary();
    return json;
  }

 private:
  Json message(const Json& params) { return {{"type", "run"}, {"id", ++id_}, {"params", params}}; }
  void run(const Json& params) {
    page_.send(message(params));
    while (page_.next({"result"})["id"] != id_) {
    }
    page_.read_until(Clock::now() + std::chrono::milliseconds(300));  // let it settle
    page_.send({{"type", "cancel"}, {"id", ++id_}});
    page_.next({"cancelled"});
  }

  const Program& program_;
  Page& page_;
  const Options& options_;
  Json base_;
  int id_ = 0;
};

Json measure(const Options& options) {
  const std::string folder = std::filesystem::temp_directory_path() / ("bench_viewer-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  pointfair::write(folder + "/torus.ply", noisy_torus(options.points));
  const auto start = Clock::now();
  const Program program(options, folder + "/torus.ply");
  Page page(program.port());
  const Json hello = page.next({"hello"});
  page.next({"cloud"});
  const double ready = milliseconds(Clock::now() - start);
  const std::size_t cloud_bytes = page.bytes;
  std::filesystem::remove_all(folder);
  Bench bench(program, page, options);
  Json json{{"device", hello["device"]},
            {"points", options.points},
            {"k", options.k},
            {"cloud", {{"ms", ready}, {"bytes", cloud_bytes}}}};
  // a run within radii keeps no lists, so that the next must search them: a smaller k would read a part of those there
  const Json within_radii{{"radius", "2s"}, {"iterations", "1"}},
      single{{"k", std::to_string(options.k)}, {"iterations", "1"}};
  json["sliders"] = {{"last_stage", bench.slider("similarity_sigma", {"0.4s", "0.5s"})},
                     {"normals", bench.slider("normal_sigma", {"2s", "2.2s"})},
                     {"neighbors", bench.slider("similarity_sigma", {"0.4s", "0.5s"}, within_radii)},
                     {"second_iteration", bench.slider("iterations", {"2"}, single)}};
  if (options.cancels > 0) json["cancel"] = bench.cancel();
  return json;
}

Options parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string flag = argv[i], value = argv[i + 1];
    if (flag == "--points")
      options.points = std::stoi(value);
    else if (flag == "--k")
      options.k = std::stoi(value);
    else if (flag == "--repeat")
      options.repeat = std::stoi(value);
    else if (flag == "--cancels")
      options.cancels = std::stoi(value);
    else if (flag == "--device")
      options.device = value;
    else if (flag == "--program")
      options.program = value;
    else
      throw std::invalid_argument("unknown flag " + flag);
  }
  return options;
}

}  // namespace

int main(int argc, char** argv) try {
  std::cout << measure(parse(argc, argv)).dump(2) << '\n';
  return 0;
} catch (const std::exception& error) {
  std::cerr << "bench_viewer: " << error.what() << '\n';
  return 1;
}
