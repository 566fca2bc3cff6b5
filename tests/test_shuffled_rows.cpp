// SPDX-License-Identifier: Apache-2.0
// The same rows in another order give the same results, row by row and bit for bit.
#include <memory>

#include "shuffled_rows.h"

namespace pointfair {
namespace {

constexpr int kPoints = 1500;

TEST(ShuffledRows, have_the_same_lists) {
  const std::unique_ptr<Backend> backend = make_cpu_backend(2);
  for (const auto& cloud : shuffled_rows::clouds(kPoints)) shuffled_rows::expect_the_same_lists(*backend, cloud);
}

TEST(ShuffledRows, have_the_same_sums_over_one_radius) {
  const std::unique_ptr<Backend> backend = make_cpu_backend(2);
  for (const auto& cloud : shuffled_rows::clouds(kPoints)) shuffled_rows::expect_the_same_sums(*backend, cloud);
  shuffled_rows::expect_the_same_sums(*backend, shuffled_rows::in_few_cells(2000));
}

// A step that floats of the cloud's size can take without rounding.
TEST(ShuffledRows, moved_by_what_rounds_nowhere_move_alike) {
  const std::unique_ptr<Backend> backend = make_cpu_backend(2);
  const shapes::Points points = shuffled_rows::on_a_grid(shapes::with_noise(shapes::waves(kPoints), 0.01), 0x1p-10f);
  const Point by{4, -2, 8};
  for (const int k : shuffled_rows::kEveryK) {
    StageSettings settings{.neighbors = {k, 0, false, 0}};
    const StageResults plain = run(*backend, points, settings),
                       moved = run(*backend, shapes::shifted(points, by), settings);
    EXPECT_EQ(difference(plain.normals, moved.normals), "") << k;
  }
}

}  // namespace
}  // namespace pointfair
