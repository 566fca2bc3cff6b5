// SPDX-License-Identifier: Apache-2.0
// Denoises a file. All parameters are chosen from the data.
//   denoise_file scan.ply denoised.ply
#include <cstdio>
#include <pointfair/pointfair.hpp>

int main(int count, char** words) {
  if (count != 3) {
    std::fprintf(stderr, "usage: denoise_file IN OUT\n");
    return 2;
  }
  try {
    const pointfair::Cloud cloud = pointfair::read(words[1]);
    pointfair::Pipeline pipeline;  // on a CUDA card if there is one, else on the CPU
    pipeline.load(cloud);
    const pointfair::Cloud denoised = pipeline.run();
    pointfair::write(words[2], denoised);

    const pointfair::Report& report = pipeline.report();
    std::printf("%zu points, noise %g, %.1f ms on %s\n", denoised.points.size(), report.params.noise.value,
                report.total_milliseconds, report.device.name.c_str());
  } catch (const pointfair::Error& error) {  // the only type that pointfair throws
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
