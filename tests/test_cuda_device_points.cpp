// SPDX-License-Identifier: Apache-2.0
// Clouds that lie on the card against the same in host memory, bit for bit, in every layout, and in the order of the
// caller's streams. Skipped where no card can be used.
#include <cuda_runtime_api.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <limits>
#include <thread>

#include "backend_runs.h"
#include "pointfair/pointfair.hpp"
#include "runs.h"
#include "shapes.h"
#include "slow_tools.h"

namespace pointfair {
namespace {

class CudaDevicePointsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    int cards = 0;
    if (cudaGetDeviceCount(&cards) != cudaSuccess || cards == 0) GTEST_SKIP() << "no CUDA card can be used";
    ASSERT_EQ(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), cudaSuccess);
  }
  void TearDown() override {
    for (void* memory : allocated_) cudaFree(memory);
    if (stream_ != nullptr) cudaStreamDestroy(stream_);
  }

  void* on_card(const void* from, std::size_t bytes) {
    void* memory = nullptr;
    EXPECT_EQ(cudaMalloc(&memory, std::max<std::size_t>(bytes, 1)), cudaSuccess);
    allocated_.push_back(memory);
    if (from == nullptr) return memory;
    EXPECT_EQ(cudaMemcpy(memory, from, bytes, cudaMemcpyHostToDevice), cudaSuccess);
    EXPECT_EQ(cudaDeviceSynchronize(), cudaSuccess);  // a copy from ordinary memory may return before it is done
    return memory;
  }
  DeviceStream stream() const { return {stream_}; }

  cudaStream_t stream_ = nullptr;
  std::vector<void*> allocated_;
};

std::vector<Point> noisy_sphere(int count) {
  std::vector<Point> points = shapes::sphere(count, 3);
  shapes::Random random(4);
  for (Point& p : points) {
    const float r = float(1 + 0.004 * random.normal());
    p = {p.x * r, p.y * r, p.z * r};
  }
  points[7].y = std::numeric_limits<float>::quiet_NaN();
  return points;
}

std::vector<Params> kinds_of_params() {
  Params listed{.k = 8, .outliers = Outliers::off, .iterations = 1};
  return {Params{}, listed};
}

// x, y, z of point i at i * row + axis * column.
template <class T>
std::vector<T> laid_out(const std::vector<Position>& positions, std::ptrdiff_t row, std::ptrdiff_t column) {
  std::vector<T> values(positions.size() * 4 + 8, T(-7));
  for (std::size_t i = 0; i < positions.size(); ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      values[i * std::size_t(row) + axis * std::size_t(column)] = T(positions[i][axis]);
  return values;
}

// By the calls for positions in host memory, on the same card.
template <class T>
std::vector<T> by_host(const std::vector<T>& values, std::size_t count, std::ptrdiff_t row, std::ptrdiff_t column,
                       const Params& params) {
  std::vector<Position> positions(count);
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      positions[i][axis] = values[i * std::size_t(row) + axis * std::size_t(column)];
  const Cloud before = make_cloud(positions);
  Pipeline pipeline(Device::cuda);
  move_positions(before, result_of(pipeline, before.points, params), positions);
  std::vector<T> result = values;
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      result[i * std::size_t(row) + axis * std::size_t(column)] = T(positions[i][axis]);
  return result;
}

TEST_F(CudaDevicePointsTest, give_the_bits_of_host_memory_in_every_type_layout_and_place) {
  struct Layout {
    std::ptrdiff_t row, column;
  };
  const int count = int(slow_tools::most_points(20000));
  const auto check = [&]<class T>(T, double offset, Layout layout, const Params& params) {
    std::vector<Position> positions;
    for (const Point& p : noisy_sphere(count)) positions.push_back({p.x + offset, p.y - offset / 2, double(p.z)});
    const std::vector<T> values = laid_out<T>(positions, layout.row, layout.column);
    const ScalarType type = sizeof(T) == 4 ? ScalarType::float32 : ScalarType::float64;
    const std::vector<T> expected = by_host(values, count, layout.row, layout.column, params);
    void* const memory = on_card(values.data(), values.size() * sizeof(T));
    Pipeline pipeline(Device::cuda);
    pipeline.load({memory, std::size_t(count), layout.row, layout.column, type}, stream());
    pipeline.run(params, {memory, std::size_t(count), layout.row, layout.column, type}, stream());
    std::vector<T> result(values.size());
    ASSERT_EQ(cudaMemcpy(result.data(), memory, result.size() * sizeof(T), cudaMemcpyDeviceToHost), cudaSuccess);
    std::size_t different = 0;
    for (std::size_t i = 0; i < result.size(); ++i)
      different += std::memcmp(&result[i], &expected[i], sizeof(T)) != 0 &&
                   !(result[i] != result[i] && expected[i] != expected[i]);
    EXPECT_EQ(different, 0u) << sizeof(T) << " bytes, offset " << offset << ", row " << layout.row;
    EXPECT_NE(result, values);
  };
  for (const Params& params : kinds_of_params())
    for (const double offset : {0.0, 4.5e5})
      for (const Layout layout : {Layout{3, 1}, Layout{4, 1}, Layout{1, count}}) {
        check(float{}, offset, layout, params);
        check(double{}, offset, layout, params);
      }
}

TEST_F(CudaDevicePointsTest, many_at_one_place_have_the_origin_of_arrays) {
  std::vector<Position> positions(slow_tools::most_points(20000), Position{1000.25, 2000.5, 30.125});
  for (std::size_t i = 0; i < 40; ++i) positions[i * (positions.size() / 50)][0] += 0.25 * double(i + 1);
  void* const memory = on_card(positions.data(), positions.size() * sizeof(Position));
  Pipeline pipeline(Device::cuda);
  EXPECT_EQ(pipeline.load({memory, positions.size(), 3, 1, ScalarType::float64}, stream()), choose_origin(positions));
}

struct Producer {
  const void* from;
  void* to;
  std::size_t bytes;
};

// The stream's work begins late, and the points are there only then.
TEST_F(CudaDevicePointsTest, wait_for_a_late_producer_and_hold_up_the_next_writer) {
  const std::vector<Point> points = noisy_sphere(int(slow_tools::most_points(50000)));
  std::vector<Point> result(points.size());
  Params params = kinds_of_params()[1];
  Pipeline pipeline(Device::cuda);
  const std::vector<Point> expected = result_of(pipeline, points, params);
  const std::size_t bytes = points.size() * sizeof(Point);
  void* const source = on_card(points.data(), bytes);
  void* const memory = on_card(nullptr, bytes);
  void* const out = on_card(nullptr, bytes);
  ASSERT_EQ(cudaMemset(memory, 0, bytes), cudaSuccess);
  for (int turn = 0; turn < 3; ++turn) {
    const auto sleep = [](void*) { std::this_thread::sleep_for(std::chrono::milliseconds(100)); };
    ASSERT_EQ(cudaLaunchHostFunc(stream_, sleep, nullptr), cudaSuccess);
    ASSERT_EQ(cudaMemcpyAsync(memory, source, bytes, cudaMemcpyDeviceToDevice, stream_), cudaSuccess);
    pipeline.load({memory, points.size()}, stream());
    ASSERT_EQ(cudaMemsetAsync(memory, 0, bytes, stream_), cudaSuccess);
    pipeline.run(params, {out, points.size()}, stream());
    ASSERT_EQ(cudaMemcpy(result.data(), out, bytes, cudaMemcpyDeviceToHost), cudaSuccess);
    ASSERT_EQ(std::memcmp(result.data(), expected.data(), 7 * sizeof(Point)), 0);
    EXPECT_EQ(std::memcmp(result.data() + 8, expected.data() + 8, bytes - 8 * sizeof(Point)), 0);
  }
}

TEST_F(CudaDevicePointsTest, refined_points_stay_on_the_card) {
  const std::vector<Point> points = noisy_sphere(int(slow_tools::most_points(20000)));
  std::vector<Point> result(points.size());
  const std::size_t bytes = points.size() * sizeof(Point);
  void* const memory = on_card(points.data(), bytes);
  Params params{.method = Method::learned};
  Pipeline pipeline(Device::cuda);
  const std::vector<Point> expected = result_of(pipeline, points, params);
  pipeline.load({memory, points.size()}, stream());
  pipeline.run(params, {memory, points.size()}, stream());
  ASSERT_EQ(cudaMemcpy(result.data(), memory, bytes, cudaMemcpyDeviceToHost), cudaSuccess);
  EXPECT_EQ(std::memcmp(result.data(), expected.data(), bytes), 0);
}

TEST_F(CudaDevicePointsTest, have_the_bits_of_the_cpu_where_points_are_repeated) {
  std::vector<Point> points = shapes::repeated(noisy_sphere(int(slow_tools::most_points(6000))), 3, 1e-7);
  points[90] = {1.3f * points[90].x, 1.3f * points[90].y, 1.3f * points[90].z};
  std::vector<Point> expected(points.size()), expected_normals(points.size()), result(points.size());
  const std::size_t bytes = points.size() * sizeof(Point);
  for (const Params& params :
       {Params{.outliers = Outliers::mark}, Params{.method = Method::learned, .outliers = Outliers::mark}}) {
    Pipeline cpu(Device::cpu), card(Device::cuda);
    cpu.load(points);
    cpu.run(params, expected);
    cpu.normals(expected_normals);
    void* const memory = on_card(points.data(), bytes);
    card.load({memory, points.size()}, stream());
    for (int turn = 0; turn < 2; ++turn) {
      card.run(params, {memory, points.size()}, stream());
      ASSERT_EQ(cudaMemcpy(result.data(), memory, bytes, cudaMemcpyDeviceToHost), cudaSuccess);
      EXPECT_EQ(difference(result, expected), "");
      EXPECT_TRUE(std::ranges::equal(card.outliers(), cpu.outliers()));
      EXPECT_EQ(card.report().unmoved, cpu.report().unmoved);
      EXPECT_EQ(card.report().copies, cpu.report().copies);
      card.normals({memory, points.size()}, stream());
      ASSERT_EQ(cudaMemcpy(result.data(), memory, bytes, cudaMemcpyDeviceToHost), cudaSuccess);
      EXPECT_EQ(difference(result, expected_normals), "");
    }
  }
}

TEST_F(CudaDevicePointsTest, normals_stay_on_the_card) {
  const std::vector<Point> points = noisy_sphere(int(slow_tools::most_points(5000)));
  std::vector<Point> expected(points.size()), result(points.size());
  void* const memory = on_card(points.data(), points.size() * sizeof(Point));
  Pipeline pipeline(Device::cuda);
  pipeline.load({memory, points.size()}, stream());
  pipeline.run({}, {memory, points.size()}, stream());
  pipeline.normals(expected);
  pipeline.normals({memory, points.size()}, stream());
  ASSERT_EQ(cudaMemcpy(result.data(), memory, points.size() * sizeof(Point), cudaMemcpyDeviceToHost), cudaSuccess);
  EXPECT_EQ(std::memcmp(result.data(), expected.data(), points.size() * sizeof(Point)), 0);
}

TEST_F(CudaDevicePointsTest, elsewhere_are_refused_with_a_sentence) {
  std::vector<Point> points = noisy_sphere(int(slow_tools::most_points(3000)));
  Pipeline pipeline(Device::cuda);
  expect_error(ErrorKind::usage, "in host memory", [&] { pipeline.load({points.data(), points.size()}, stream()); });
  void* const memory = on_card(points.data(), points.size() * sizeof(Point));
  DevicePoints elsewhere{memory, points.size()};
  elsewhere.card = 1;
  expect_error(ErrorKind::usage, "on card 1", [&] { pipeline.load(elsewhere, stream()); });
  pipeline.load({memory, points.size()}, stream());
  expect_error(ErrorKind::usage, "in host memory", [&] { pipeline.run({}, {points.data(), points.size()}, stream()); });
  void* const wide = on_card(nullptr, points.size() * sizeof(Position));
  expect_error(ErrorKind::usage, "another type", [&] {
    pipeline.run({}, {wide, points.size(), 3, 1, ScalarType::float64}, stream());
  });
  pipeline.run({}, {memory, points.size()}, stream());
  pipeline.load(DevicePoints{}, stream());
  pipeline.run({}, DeviceOutput{}, stream());
}

}  // namespace
}  // namespace pointfair
