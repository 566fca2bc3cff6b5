// SPDX-License-Identifier: Apache-2.0
// The net of method learned on a card, against the integer reference in Python and against the CPU, bit for bit.
#include <cmath>
#include <cstring>

#include "cuda_backend_test.h"
#include "learned_clouds.h"
#include "pipeline/pipeline_access.hpp"
#include "pointfair/pipeline.hpp"
#include "tiles/tiled_backend.hpp"

namespace pointfair {
namespace {

using shapes::Points;

class CudaLearned : public CudaBackendTest {
 protected:
  static Points run(Pipeline& pipeline, const Points& points, Params params) {
    params.method = Method::learned;
    return result_of(pipeline, points, params);
  }
  static Points run(Device::Kind kind, const Points& points, const Params& params = {}) {
    Pipeline pipeline{Device(kind)};
    return run(pipeline, points, params);
  }
};

Points in_steps(Points points, float step) {
  for (Point& p : points)
    p = {std::round(p.x / step) * step, std::round(p.y / step) * step, std::round(p.z / step) * step};
  return points;
}

TEST_F(CudaLearned, gives_the_bits_of_the_integer_reference) {
  Refinement* const card = cuda_->refinement();
  ASSERT_NE(card, nullptr);
  int number = 0;
  for (const learned_clouds::Golden& cloud : learned_clouds::golden_clouds()) {
    Points out(cloud.measured.size());
    card->refine(cloud.input(), *own_net_weights(), cloud.frame, out, {});
    EXPECT_EQ(learned_clouds::differing(out, cloud.refined), 0u) << "cloud " << number++;
  }
}

TEST_F(CudaLearned, equals_the_cpu) {
  const Points hard = [] {
    Points points = shapes::with_stray(shapes::with_invalid(shapes::with_noise(shapes::sphere(9000), 0.01), 11), 50);
    for (std::size_t i = 0; i < 300; ++i) points[5 * i] = points[1];
    return points;
  }();
  for (const Points& whole :
       {shapes::with_noise(shapes::waves(12000), 0.004), shapes::with_noise(shapes::uneven(9000, 1000), 0.0005),
        shapes::flat_grid(60), shapes::with_noise(shapes::cube(150000), 0.01), hard, shapes::sphere(20),
        shapes::identical(40), in_steps(shapes::with_noise(shapes::waves(20000), 0.004), 0.015625f),
        noisy_sphere(1200000, 31, 0.002), Points{}}) {
    const Points points = cut(whole);
    EXPECT_EQ(learned_clouds::differing(run(Device::cuda, points), run(Device::cpu, points)), 0u) << points.size();
  }
}

// Of what neighbours add, each weight as large as can be: their sums need more than 16 bits.
std::vector<std::byte> loud_weights() {
  std::vector<std::byte> file = learned_clouds::bytes_of(learned_clouds::kWeightsFile);
  namespace net = point::net;
  constexpr std::size_t kC = net::kChannels, kHeader = 28, kBias = 4 * kC, kSquare = kC * kC;
  std::size_t at = kHeader + kC * net::kPointFeatures + kBias;
  for (int layer = 0; layer < net::kLayers; ++layer) {
    at += kSquare + kBias;
    for (std::size_t i = at; i < at + kSquare; ++i)
      file[i] = std::byte(static_cast<signed char>(file[i]) < 0 ? -127 : 127);
    at += kSquare + kC * net::kEdgeFeatures + 3 * kSquare + kBias + (layer >= net::kFirstGated ? kC * net::kGates : 0);
  }
  std::uint64_t fingerprint = 0xcbf29ce484222325u;
  for (std::size_t i = kHeader; i < file.size(); ++i)
    fingerprint = (fingerprint ^ static_cast<std::uint64_t>(file[i])) * 0x100000001b3u;
  std::memcpy(file.data() + 16, &fingerprint, sizeof(fingerprint));
  return file;
}

TEST_F(CudaLearned, equals_the_cpu_where_sums_are_clamped) {
  const Points points = cut(shapes::with_noise(shapes::waves(12000), 0.01));
  Pipeline cuda(Device::cuda), cpu(Device::cpu);
  for (Pipeline* its : {&cuda, &cpu}) its->set_weights(loud_weights(), "loud");
  EXPECT_EQ(learned_clouds::differing(run(cuda, points, {}), run(cpu, points, {})), 0u);
}

TEST_F(CudaLearned, equals_the_cpu_with_other_parameters) {
  const Points points = cut(shapes::with_stray(shapes::with_noise(shapes::sphere(9000), 0.02), 40));
  Params limited, twice, marked, softer;
  limited.displacement_limit = 0.004;
  twice.iterations = 2;
  marked.outliers = Outliers::mark;
  softer.noise = 0.01;
  for (const Params& params : {limited, twice, marked, softer}) {
    Pipeline cuda(Device::cuda), cpu(Device::cpu);
    EXPECT_EQ(learned_clouds::differing(run(cuda, points, params), run(cpu, points, params)), 0u);
    EXPECT_EQ(cuda.report().unmoved.outliers, cpu.report().unmoved.outliers);
  }
}

// The net takes the memory of neighbourhoods that later runs may read again.
TEST_F(CudaLearned, leaves_the_results_of_later_runs_as_they_are) {
  const Points points = cut(noisy_sphere(30000, 26, 0.01));
  Pipeline cuda(Device::cuda), cpu(Device::cpu);
  cuda.load(points);
  cpu.load(points);
  for (const Method method : {Method::learned, Method::bilateral, Method::learned}) {
    for (const int iterations : {2, 1}) {
      Params params{.method = method, .similarity_sigma = 0.01 * (iterations + int(method)), .iterations = iterations};
      Points on_card(points.size()), on_cpu(points.size());
      cuda.run(params, on_card);
      cpu.run(params, on_cpu);
      EXPECT_EQ(learned_clouds::differing(on_card, on_cpu), 0u);
    }
  }
}

// Refined on the host's cores, on a card, and on the host's because the card has too little memory.
TEST_F(CudaLearned, of_a_cloud_in_tiles_equals_the_cpu) {
  const Points points = cut(noisy_sphere(60000, 25, 0.01)), expected = run(Device::cpu, points);
  const auto card = [] { return make_cuda_backend(0); };
  const auto small_card = [] { return make_cuda_backend(0, {.memory = 1 << 20}); };
  for (const MakeWorkers& refiners : {MakeWorkers{}, MakeWorkers{{card}}, MakeWorkers{{small_card}}}) {
    std::vector<std::unique_ptr<Backend>> workers;
    for (int i = 0; i < 2; ++i) workers.push_back(make_cuda_backend(0));
    Pipeline tiles =
        PipelineAccess::make(make_tiled_backend(std::move(workers), {5}), {Device::cuda, "", ""}, refiners);
    EXPECT_EQ(learned_clouds::differing(run(tiles, points, {}), expected), 0u);
  }
}

}  // namespace
}  // namespace pointfair
