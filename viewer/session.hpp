// SPDX-License-Identifier: Apache-2.0
// One cloud and one user. A worker thread runs the pipeline, or the caller does in steps; new parameters stop the run
// that is under way and replace those that wait. Knows nothing of networks: messages of the page come in as text,
// answers go out through a function.
//
// Memory beside the pipeline's own, a point of the cloud: 36 bytes (the cloud, the result, normals), 1 with a box or
// lasso; beside the message on its way, 4 a point that the page holds. Shading has a second pipeline (shading.hpp).
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "message.hpp"
#include "pointfair/pointfair.hpp"

namespace pointfair::viewer {

class Session {
 public:
  /// Takes a message for the page. Called from the worker thread only; may wait until earlier ones have left, and
  /// returns at once where there is no page.
  using Send = std::function<void(Bytes)>;

  struct Options {
    std::function<Pipeline()> make_pipeline;  ///< on the device that the user chose
    std::filesystem::path save_folder = ".";  ///< the only folder that saving writes to
    std::uint64_t point_budget = 3'000'000;   ///< points that the page gets of a larger cloud
    std::string viewpoint{};                  ///< of the cloud that the server opens, as parse_viewpoints reads it
    ReadOptions reading{};                    ///< that this cloud was read with
    std::uint64_t most_points = 0;            ///< of a cloud that is opened; 0: any number
    bool saves_to_page = false;               ///< a saved file goes to the page, and not into a folder
    bool own_thread = true;                   ///< false: the session works in step() only
  };

  Session(Options options, Send send);
  ~Session();  ///< stops what runs and waits for it
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Takes a cloud that was read from `path`, before there is a page.
  void open(Cloud cloud, const std::filesystem::path& path);

  // The next four return whether the session takes the task. One that is taken is done and answered; false means that
  // too many wait already, and that nothing was done.

  /// Reads a cloud from the bytes of a file called `name` and shows it; an error is sent to the page.
  [[nodiscard]] bool open(std::string bytes, std::string name);

  /// Holds a file that the mesh names which is opened next, a library of materials or a picture. Where it is too large,
  /// an error is sent to the page.
  [[nodiscard]] bool hold(std::string bytes, std::string name);

  /// A new page is there: sends it what it needs to begin.
  [[nodiscard]] bool greet();

  /// A message of the page. Never throws: what is wrong with it is sent back. Cheap, for a network thread.
  [[nodiscard]] bool receive(std::string_view text);

  /// Without a thread of its own: does the next task that is due. Returns the time until the next one is; none: nothing
  /// is left to do. Later calls of the others are heard between two steps only, so that nothing stops a run.
  std::optional<std::chrono::milliseconds> step();

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace pointfair::viewer
