// SPDX-License-Identifier: Apache-2.0
// Peer: the paper's method (eq. 1-6, one pass) as a competent programmer writes it in an afternoon: nanoflann for the
// neighbours, Eigen for the normals, one parallel loop a stage, points left in the order they came in.
#include <Eigen/Eigenvalues>
#include <cmath>

#include "nanoflann_neighbors.hpp"

namespace {

using Eigen::Matrix3f;
using Eigen::Vector3f;
using peer::NeighborLists;
using peer::Point;
using Points = std::vector<Point>;

constexpr int kAreaNeighbors = 5;
constexpr std::size_t kSamples = 1000;  // points that the widths of the Gaussians are measured on

Vector3f vector_of(const Point& p) { return {p.x, p.y, p.z}; }
float gaussian(float squared, float sigma) { return std::exp(-squared / (2 * sigma * sigma)); }

// Half the mean distance to the k-th neighbour: the paper's r = 2 sigma_c.
float closeness_sigma(const NeighborLists& lists, std::size_t count) {
  const std::size_t step = std::max<std::size_t>(1, count / kSamples);
  double sum = 0;
  std::size_t samples = 0;
  for (std::size_t i = 0; i < count; i += step, ++samples) {
    sum += std::sqrt(lists.squared_distances[(i + 1) * static_cast<std::size_t>(lists.k) - 1]);
  }
  return static_cast<float>(0.5 * sum / static_cast<double>(samples));
}

// Standard deviation of the neighbours' heights above the tangent planes (Fleishman et al. 2003).
float similarity_sigma(const Points& points, const NeighborLists& lists, const std::vector<Vector3f>& normals) {
  const std::size_t step = std::max<std::size_t>(1, points.size() / kSamples);
  double sum = 0, samples = 0;
  for (std::size_t i = 0; i < points.size(); i += step) {
    for (const std::uint32_t j : lists.of(i)) {
      const float height = normals[i].dot(vector_of(points[i]) - vector_of(points[j]));
      sum += height * height;
      ++samples;
    }
  }
  return static_cast<float>(std::sqrt(sum / samples));
}

// Eq. 3-5. The centroid is normalised, and taken of offsets.
Vector3f normal_of(std::size_t i, const Points& points, const NeighborLists& lists, float sigma) {
  const Vector3f center = vector_of(points[i]);
  Vector3f centroid = Vector3f::Zero();
  float total = 0;
  for (const std::uint32_t j : lists.of(i)) {
    const Vector3f offset = vector_of(points[j]) - center;
    const float w = gaussian(offset.squaredNorm(), sigma);
    centroid += w * offset;
    total += w;
  }
  if (total > 0) centroid /= total;
  Matrix3f covariance = Matrix3f::Zero();
  for (const std::uint32_t j : lists.of(i)) {
    const Vector3f d = vector_of(points[j]) - center - centroid;
    const float w = gaussian(d.squaredNorm(), sigma);
    covariance += (w * w) * d * d.transpose();
  }
  Eigen::SelfAdjointEigenSolver<Matrix3f> solver;
  solver.computeDirect(covariance);
  return solver.eigenvectors().col(0);
}

// W_a: the square of the mean distance to the five nearest.
float area_of(std::size_t i, const NeighborLists& lists) {
  const int count = std::min(kAreaNeighbors, lists.k);
  float sum = 0;
  for (int j = 0; j < count; ++j) {
    sum += std::sqrt(lists.squared_distances[i * static_cast<std::size_t>(lists.k) + static_cast<std::size_t>(j)]);
  }
  const float mean = sum / static_cast<float>(count);
  return mean * mean;
}

// Eq. 1, 2 and 6.
Point faired(std::size_t i, const Points& points, const NeighborLists& lists, const Vector3f& normal,
             const std::vector<float>& areas, float sigma_c, float sigma_s) {
  const Vector3f center = vector_of(points[i]);
  float moment = 0, total = 0;
  for (const std::uint32_t j : lists.of(i)) {
    const Vector3f offset = center - vector_of(points[j]);
    const float height = normal.dot(offset);
    const float w = gaussian(offset.squaredNorm(), sigma_c) * gaussian(height * height, sigma_s) * areas[j];
    moment += w * height;
    total += w;
  }
  if (!(total > 0)) return points[i];
  const Vector3f moved = center - (moment / total) * normal;
  return {moved.x(), moved.y(), moved.z()};
}

peer::Outcome run(const Points& points, const peer::Arguments& arguments) {
  const std::size_t count = points.size();
  peer::Outcome outcome;
  peer::Stopwatch watch;
  const peer::PointArray array{points};
  const peer::Tree tree(3, array);
  outcome.parts.emplace_back("index", watch.lap());

  const NeighborLists lists = peer::find_neighbors(tree, points, arguments.k, arguments.threads);
  outcome.parts.emplace_back("neighbors", watch.lap());

  const float sigma = closeness_sigma(lists, count);
  std::vector<Vector3f> normals(count);
  std::vector<float> areas(count);
  peer::parallel_for(count, arguments.threads, [&](std::size_t i) {
    normals[i] = normal_of(i, points, lists, sigma);
    areas[i] = area_of(i, lists);
  });
  outcome.parts.emplace_back("normals", watch.lap());

  const float sigma_s = similarity_sigma(points, lists, normals);
  outcome.points.resize(count);
  peer::parallel_for(count, arguments.threads, [&](std::size_t i) {
    outcome.points[i] = faired(i, points, lists, normals[i], areas, sigma, sigma_s);
  });
  outcome.parts.emplace_back("fairing", watch.lap());
  return outcome;
}

peer::Run prepare(const Points& points, const peer::Arguments& arguments) {
  return [&points, arguments] { return run(points, arguments); };
}

}  // namespace

int main(int argc, char** argv) {
  return peer::peer_main(argc, argv, "plain_pipeline", peer::nanoflann_version() + ", Eigen", prepare);
}
