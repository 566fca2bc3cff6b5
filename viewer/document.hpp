// SPDX-License-Identifier: Apache-2.0
// The open cloud, the pipelines that denoise it, and what the page is told of both. Used by the worker only.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "answers.hpp"
#include "companions.hpp"
#include "expectation.hpp"
#include "order.hpp"
#include "preview.hpp"
#include "request.hpp"
#include "session.hpp"
#include "shading.hpp"

namespace pointfair::viewer {

class Document {
 public:
  Document(Session::Options options, Session::Send send);

  /// Replaces the cloud. `path` is empty for one that came through the page. `companions`: files that it names.
  void open(Cloud cloud, const std::string& name, std::string path, Companions companions);

  /// Tells a page that has just come what it needs to begin.
  void greet();

  /// Sends the result of a run, and before it a preview where the run is expected to take long. The first throws what
  /// Pipeline::run throws, as do the next two.
  void run(const Request& request, std::stop_token stop);

  /// Sends what can wait until the user rests: the normals of the last result.
  void send_shading(std::stop_token stop);

  /// Writes the library's own run, so that the file is what the command writes; says what goes wrong.
  void save(const Request& request, bool overwrite, std::stop_token stop);

  void send_colours(const Json& id, const std::string& name);

  /// Sends the pictures that the faces have, where they lie, and a line for each that cannot be had.
  void send_texture(const Json& id);

  /// Sends the noise at each point, as it was estimated of the cloud as loaded.
  void send_noise(const Json& id, std::stop_token stop);

  /// Sends why each point is an outlier of the last run, also where that run did not mark them. Throws what
  /// Pipeline::run throws.
  void send_outliers(const Json& id, std::stop_token stop);

  void send_error(const Json& id, std::string_view words) { send_(pack(error_answer(id, words))); }
  void send_cancelled(const Json& id, double milliseconds);

 private:
  std::optional<Params> resolved(const Params& params, const std::stop_token& stop);
  void show_preview(const Request& request, const Params& used, std::stop_token stop);
  void send_part(const Request& request, const Preview::Result& part);
  void show_result(const Request& request, const std::stop_token& stop);
  std::vector<std::string> notes_on(const Request& request, const Displacements& moved, const std::stop_token& stop);
  bool takes_motion_normals(const Report& report);
  void find_texture(const Polygons& faces);
  void send_cloud();
  void write_file(const Request& request, const WriteOptions& write_options, std::stop_token stop);
  void update_movable(const Limits& limits);
  void reload(const Limits& limits);
  std::string viewpoint() const;
  void place_sensor();
  const std::vector<Point>& seen_points() const;
  void limit(const Limits& limits, std::span<Point> after, std::span<const std::uint32_t> indices) const;
  Point focus_of(const Request& request) const;
  ProgressFunction progress_for(const Json& id) const;
  Errand errand_of(const Request& request) const;

  const Session::Options options_;
  const Session::Send send_;
  bool has_cloud_ = false;
  Cloud cloud_;
  CloudFacts facts_;
  std::vector<std::string> notes_;           // on the places of its sensor
  std::vector<std::string> notes_on_faces_;  // should they not be followed
  Companions companions_;
  Texture texture_;  // of the faces that the page draws
  Order order_;
  std::optional<Pipeline> pipeline_;
  Shading shading_;
  Preview preview_;
  Expectation expectation_;
  HostBuffer result_, normals_;              // of all points
  std::vector<std::int16_t> start_shading_;  // normals that the cloud as loaded is shaded with
  Params last_params_;                       // of the last run, as asked for
  std::vector<std::int16_t> motion_;         // normals that the page has for displacements along them; empty if none
  Params motion_params_;                     // that they came from
  std::optional<Limits> limits_;             // of movable_ and of what the pipeline holds; none: it holds nothing
  std::vector<std::uint8_t> movable_;
  std::vector<Point> without_ignored_;  // what the pipeline holds where some points are ignored, else empty
};

}  // namespace pointfair::viewer
