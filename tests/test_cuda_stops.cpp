// SPDX-License-Identifier: Apache-2.0
// Runs on a card that are stopped, before a stage and while its kernels run.
#include "cuda_backend_test.h"
#include "pointfair/pipeline.hpp"

namespace pointfair {
namespace {

// Kernels that run when a stop comes give up.
TEST_F(CudaBackendTest, a_stop_ends_kernels_that_run) {
  const std::vector<Point> points = cut(noisy_sphere(100000, 17, 0.002));
  const NeighborSettings neighbors{0, 1.0f};  // a quarter of all points
  std::stop_source stop;
  cuda_->upload(points, IndexOrder::fastest);
  cuda_->build_index(0, {}, stop.get_token());
  cuda_->find_neighbors(0, neighbors, stop.get_token());
  cuda_->estimate_normals(0, {0.1f}, stop.get_token());
  stop.request_stop();
  if (points.size() == 100000) {  // else the normals, a tenth of a second's work here, may be done
    std::vector<Point> out(points.size());
    EXPECT_THROW(cuda_->download_normals(0, out, {}), Error);
    EXPECT_EQ(cuda_->take_stopped(), (StageOf{0, Stage::normals}));
  }
  cuda_->take_stopped();
  EXPECT_EQ(cuda_->take_stopped(), std::nullopt);
  const StageSettings settings;
  EXPECT_EQ(difference(run(*cuda_, points, settings).points, run(*cpu_, points, settings).points), "");
}

// Stopped after one of its stage calls and then asked for all: what kernels gave up is never used.
TEST_F(CudaBackendTest, a_stopped_run_can_be_repeated) {
  const std::vector<Point> points = cut(noisy_sphere(30000, 18, 0.002));
  Params wide, lists, constrained;
  wide.radius = 0.3;
  lists.k = 100;
  constrained.k = 20;
  constrained.constraint = true;
  for (Params params : {wide, lists, constrained, Params{}}) {
    params.iterations = 2;
    Pipeline fresh(Device::cuda), pipeline(Device::cuda);
    std::vector<Point> expected = result_of(fresh, points, params), out(points.size());
    for (const int calls : {2, 3, 4, 7}) {
      pipeline.load(points);
      std::stop_source stop;
      int made = 0;
      try {
        pipeline.run(params, out, stop.get_token(), [&](double, std::string_view) {
          if (++made == calls) stop.request_stop();
        });
      } catch (const Error& error) {
        EXPECT_EQ(error.kind(), ErrorKind::interrupted);
      }
      pipeline.run(params, out);
      EXPECT_EQ(difference(out, expected), "") << "k " << params.k << ", stopped after call " << calls;
    }
  }
}

}  // namespace
}  // namespace pointfair
