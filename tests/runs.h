// SPDX-License-Identifier: Apache-2.0
// What most tests do: run once on the CPU, see which error a call throws, and keep files in a folder.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <span>
#include <string>
#include <vector>

#include "pointfair/pipeline.hpp"
#include "pointfair/positions.hpp"

namespace pointfair {

// `cloud`: a Cloud, or its points.
template <class Loaded>
Pipeline loaded(const Loaded& cloud, const Device& device = Device::cpu) {
  Pipeline pipeline(device);
  pipeline.load(cloud);
  return pipeline;
}

inline std::vector<Point> result_of(Pipeline& pipeline, std::span<const Point> points, const Params& params = {}) {
  std::vector<Point> out(points.size());
  pipeline.load(points);
  pipeline.run(params, out);
  return out;
}

// A pipeline on the CPU after its first run.
struct Ran {
  explicit Ran(const std::vector<Point>& cloud, const Params& params = {}, unsigned threads = 0,
               std::span<const Position> viewpoint = {})
      : pipeline(Device(Device::cpu, 0, threads)), points(cloud.size()) {
    pipeline.load(cloud);
    if (!viewpoint.empty()) pipeline.set_viewpoint(viewpoint);
    pipeline.run(params, points);
    report = pipeline.report();
    outliers.assign(pipeline.outliers().begin(), pipeline.outliers().end());
  }
  std::vector<Point> normals() {
    std::vector<Point> result(points.size());
    pipeline.normals(result);
    return result;
  }

  Pipeline pipeline;
  std::vector<Point> points;  // of the result
  Report report;
  std::vector<std::uint8_t> outliers;
};

namespace test {

// Empty where a card can be used.
inline const std::string& why_no_card() {
  static const std::string why = [] {
    std::string reason = "no card";
    for (const DeviceStatus& status : list_devices()) {
      if (status.info.kind != Device::cuda) continue;
      if (status.usable) return std::string();
      reason = status.info.reason;
    }
    return reason;
  }();
  return why;
}

// The error that `call` throws: its kind and its message. Fails the test if there is none.
struct Thrown {
  ErrorKind kind = ErrorKind::failed;
  std::string message;
};
template <class Call>
Thrown thrown_by(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return {error.kind(), error.what()};
  }
  ADD_FAILURE() << "no error was thrown";
  return {};
}

// A folder that goes away with the test.
class Folder {
 public:
  Folder() {
    std::string pattern = (std::filesystem::temp_directory_path() / "pointfair-test-XXXXXX").string();
    path_ = ::mkdtemp(pattern.data());
  }
  ~Folder() { std::filesystem::remove_all(path_); }
  std::filesystem::path operator/(const std::string& name) const { return path_ / name; }
  // Names of all that is in it.
  std::vector<std::string> names() const {
    std::vector<std::string> found;
    for (const auto& entry : std::filesystem::directory_iterator(path_)) found.push_back(entry.path().filename());
    std::sort(found.begin(), found.end());
    return found;
  }

 private:
  std::filesystem::path path_;
};

inline void put_file(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary) << bytes;
}

inline std::string file_bytes(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), {});
}

}  // namespace test

// Fails the test unless `call` throws an error of this kind whose message has this part.
template <class Call>
void expect_error(ErrorKind kind, const std::string& part, const Call& call) {
  const test::Thrown thrown = test::thrown_by(call);
  EXPECT_EQ(thrown.kind, kind) << thrown.message;
  EXPECT_NE(thrown.message.find(part), std::string::npos) << thrown.message;
}

}  // namespace pointfair
