// SPDX-License-Identifier: Apache-2.0
#include "session.hpp"

#include <chrono>
#include <span>
#include <utility>

#include "document.hpp"
#include "request.hpp"
#include "worker.hpp"

namespace pointfair::viewer {

using Clock = std::chrono::steady_clock;

// The document is touched by the worker only, which ends before it.
struct Session::Parts {
  Document document;
  Companions coming;  // of the cloud that the page sends next; touched by the worker only
  Worker worker;

  Parts(const Options& options, Send send)
      : document(options, std::move(send)),
        worker({[this](const Request& request, std::stop_token stop) { document.run(request, stop); },
                [this](std::stop_token stop) { document.send_shading(stop); },
                [this](const Json& id, std::string_view words) { document.send_error(id, words); }},
               options.own_thread ? Worker::Turns::own_thread : Worker::Turns::of_caller) {}

  void open(Cloud cloud, const std::string& name, std::string path, Companions companions) {
    worker.forget_rest();
    document.open(std::move(cloud), name, std::move(path), std::move(companions));
  }

  bool refuse(const Json& id, std::string words) {
    return worker.post([this, id, words = std::move(words)](std::stop_token) { document.send_error(id, words); });
  }

  bool take(const Json& message, Clock::time_point received);
};

// A message that is an object of JSON.
bool Session::Parts::take(const Json& message, Clock::time_point received) {
  const Json id = message.value("id", Json());
  const std::string type = string_in(message, "type");
  if (type == "run") {
    worker.submit(read_request(message, received));
    return true;
  } else if (type == "cancel") {
    return worker.cancel([this, id, received](std::stop_token) {
      document.send_cancelled(id, std::chrono::duration<double, std::milli>(Clock::now() - received).count());
    });
  } else if (type == "colours") {
    return worker.post(
        [this, id, name = string_in(message, "name")](std::stop_token) { document.send_colours(id, name); });
  } else if (type == "texture") {
    return worker.post([this, id](std::stop_token) { document.send_texture(id); });
  } else if (type == "noise") {
    return worker.post([this, id](std::stop_token stop) { document.send_noise(id, stop); });
  } else if (type == "outliers") {
    return worker.post([this, id](std::stop_token stop) { document.send_outliers(id, stop); });
  } else if (type == "save") {
    const bool overwrite = message.contains("overwrite") && message["overwrite"] == true;
    return worker.post([this, overwrite, request = read_request(message, received)](std::stop_token stop) {
      document.save(request, overwrite, stop);
    });
  }
  return refuse(id, "unknown type of message");
}

Session::Session(Options options, Send send) : parts_(std::make_unique<Parts>(options, std::move(send))) {}
Session::~Session() = default;

void Session::open(Cloud cloud, const std::filesystem::path& path) {
  const auto shared = std::make_shared<Cloud>(std::move(cloud));
  (void)parts_->worker.post([parts = parts_.get(), shared, path](std::stop_token) {
    parts->open(std::move(*shared), path.filename().string(),
                std::filesystem::absolute(path).lexically_normal().string(), Companions::in_folder_of(path));
  });
}

bool Session::open(std::string bytes, std::string name) {
  const auto shared = std::make_shared<std::string>(std::move(bytes));
  return parts_->worker.post([parts = parts_.get(), shared, name](std::stop_token) {
    Companions companions = std::exchange(parts->coming, {});  // gone, too, where the cloud cannot be read
    parts->open(read(std::as_bytes(std::span(*shared)), name), name, "", std::move(companions));
    parts->document.greet();
  });
}

bool Session::hold(std::string bytes, std::string name) {
  const auto shared = std::make_shared<std::string>(std::move(bytes));
  return parts_->worker.post(
      [parts = parts_.get(), shared, name](std::stop_token) { parts->coming.hold(std::move(*shared), name); });
}

bool Session::greet() {
  parts_->worker.forget_requests();
  return parts_->worker.post([parts = parts_.get()](std::stop_token) { parts->document.greet(); });
}

std::optional<std::chrono::milliseconds> Session::step() { return parts_->worker.step(); }

bool Session::receive(std::string_view text) {
  const auto received = Clock::now();
  Json id;
  try {
    const Json message = Json::parse(text);
    if (!message.is_object()) return parts_->refuse(id, "a message is a JSON object");
    id = message.value("id", Json());
    return parts_->take(message, received);
  } catch (const Json::exception&) {
    return parts_->refuse(id, "the message is not JSON");
  } catch (const Error& error) {
    return parts_->refuse(id, error.what());
  }
}

}  // namespace pointfair::viewer
