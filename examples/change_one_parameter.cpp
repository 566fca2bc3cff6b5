// SPDX-License-Identifier: Apache-2.0
// Runs again after one parameter has changed, as behind a slider. The pipeline keeps the result of each stage, so that
// only the stages run that read the parameter or follow one that does.
//   change_one_parameter scan.ply
#include <cstdio>
#include <pointfair/pointfair.hpp>
#include <vector>

void print_stages(const char* change, const pointfair::Report& report) {
  std::printf("%-28s", change);
  for (const pointfair::StageTime& stage : report.stages) std::printf(" %s", stage.name.c_str());
  std::printf("\n");
}

int main(int count, char** words) {
  if (count != 2) {
    std::fprintf(stderr, "usage: change_one_parameter IN\n");
    return 2;
  }
  try {
    const pointfair::Cloud cloud = pointfair::read(words[1]);
    pointfair::Pipeline pipeline;
    pipeline.load(cloud);
    std::vector<pointfair::Point> out(cloud.points.size());

    pointfair::Params params;
    params.iterations = 1;              // further iterations repeat all stages on the moved points
    params = pipeline.resolve(params);  // what is automatic stays as it is while one value changes
    pipeline.run(params, out);
    print_stages("first run:", pipeline.report());

    params.similarity_sigma.value *= 0.5;
    pipeline.run(params, out);
    print_stages("similarity_sigma changed:", pipeline.report());

    params.crease_angle += 10;
    pipeline.run(params, out);
    print_stages("crease_angle changed:", pipeline.report());

    params.radius.value *= 1.5;
    pipeline.run(params, out);
    print_stages("radius changed:", pipeline.report());
  } catch (const pointfair::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 1;
  }
}
