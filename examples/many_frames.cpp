// SPDX-License-Identifier: Apache-2.0
// Denoises many frames of one sensor. The parameters are resolved on the first frame and used for all: that saves the
// estimates, and every frame is treated alike. The noise of a depth camera differs within a frame: run with Params{}.
//   many_frames FOLDER_OUT frame1.ply frame2.ply ...
#include <cstdio>
#include <filesystem>
#include <optional>
#include <pointfair/pointfair.hpp>

int main(int count, char** words) {
  if (count < 3) {
    std::fprintf(stderr, "usage: many_frames FOLDER_OUT FRAME...\n");
    return 2;
  }
  try {
    const std::filesystem::path folder = words[1];
    pointfair::Pipeline pipeline;  // one for all frames: it keeps its memory
    std::optional<pointfair::Params> params;
    for (int i = 2; i < count; ++i) {
      const std::filesystem::path path = words[i];
      pointfair::Cloud frame = pointfair::read(path);
      pipeline.load(frame);
      if (!params) params = pipeline.resolve({});
      pipeline.run(*params, frame.points);  // in place: the pipeline holds a copy of its own
      pointfair::write(folder / path.filename(), frame);
      std::printf("%s: %.1f ms\n", path.filename().c_str(), pipeline.report().total_milliseconds);
    }
  } catch (const pointfair::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
