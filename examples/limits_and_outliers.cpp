// SPDX-License-Identifier: Apache-2.0
// Denoises half of a cloud at half strength, leaves outliers where they are, and marks them in the attribute "outlier".
//   limits_and_outliers scan.ply denoised.ply
#include <cstdio>
#include <pointfair/pointfair.hpp>

int main(int count, char** words) {
  if (count != 3) {
    std::fprintf(stderr, "usage: limits_and_outliers IN OUT\n");
    return 2;
  }
  try {
    const pointfair::Cloud cloud = pointfair::read(words[1]);
    pointfair::Pipeline pipeline;
    pipeline.load(cloud);

    pointfair::Params params{.outliers = pointfair::Outliers::mark};
    pointfair::Cloud denoised = pipeline.run(params);

    // Limits act on the result: points outside the box keep their place, but count as neighbours of those inside.
    const pointfair::Estimates& estimates = pipeline.estimates();
    pointfair::Limits limits{.strength = 0.5};
    pointfair::Box& box = limits.box.emplace();
    for (int axis = 0; axis < 3; ++axis) {
      box.min[axis] = cloud.origin[axis] + estimates.min[axis];
      box.max[axis] = cloud.origin[axis] + estimates.max[axis];
    }
    box.max[0] = (box.min[0] + box.max[0]) / 2;
    pointfair::apply_limits(limits, cloud, denoised);

    pointfair::write(words[2], denoised);
    std::printf("%llu outliers\n", static_cast<unsigned long long>(pipeline.report().unmoved.outliers));
  } catch (const pointfair::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
