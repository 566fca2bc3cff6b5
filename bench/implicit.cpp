// SPDX-License-Identifier: Apache-2.0
// Method implicit beside Eigen: the same system of uniform weights over the first ring of a mesh without a border,
// solved to the same residual by Eigen's conjugate gradients and by its direct solver, and one iteration of the default
// method along the mesh.
//
//   bench_implicit MESH [LAMBDA]     milliseconds of each, the best of three
#include <Eigen/Sparse>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <functional>
#include <string>
#include <vector>

#include "pointfair/pointfair.hpp"

namespace {

using Matrix = Eigen::SparseMatrix<double>;

double best_of_three(const std::function<void()>& work) {
  double best = 1e30;
  for (int i = 0; i < 3; ++i) {
    const auto start = std::chrono::steady_clock::now();
    work();
    best = std::min(best, std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
  }
  return best;
}

// M + lambda S of docs/methods.md, Eq. 28. Sides met twice, from the faces at both sides of an edge, count once.
Matrix system_of(const pointfair::Polygons& faces, std::size_t points, double lambda) {
  std::vector<Eigen::Triplet<double>> entries;
  std::uint64_t begin = 0;
  for (const std::uint64_t end : faces.ends) {
    for (std::uint64_t c = begin; c < end; ++c) {
      const auto a = Eigen::Index(faces.corners[c]), b = Eigen::Index(faces.corners[c + 1 < end ? c + 1 : begin]);
      entries.emplace_back(a, b, -1);
      entries.emplace_back(b, a, -1);
    }
    begin = end;
  }
  const auto count = Eigen::Index(points);
  Matrix ring(count, count);
  ring.setFromTriplets(entries.begin(), entries.end(), [](double, double) { return -1.0; });
  const Eigen::VectorXd degree = -(ring * Eigen::VectorXd::Ones(ring.cols()));
  Matrix diagonal(ring.rows(), ring.cols());
  diagonal.setIdentity();
  diagonal.diagonal() = (1 + lambda) * degree;
  return diagonal + lambda * ring;
}

Eigen::MatrixXd right_side(const Matrix& system, const Eigen::MatrixXd& before) {
  const Eigen::VectorXd mass = system * Eigen::VectorXd::Ones(system.cols());
  return mass.asDiagonal() * before - system * before;  // of displacements
}

void time_eigen(const pointfair::Cloud& cloud, double lambda) {
  Eigen::MatrixXd before(Eigen::Index(cloud.points.size()), 3);
  for (Eigen::Index i = 0; i < before.rows(); ++i) {
    const pointfair::Point& p = cloud.points[std::size_t(i)];
    before.row(i) << p.x, p.y, p.z;
  }
  const pointfair::Polygons faces = pointfair::polygons(cloud);
  Matrix system;
  std::printf("Eigen, putting the matrix together: %.0f ms\n",
              best_of_three([&] { system = system_of(faces, cloud.points.size(), lambda); }));
  const Eigen::MatrixXd right = right_side(system, before);
  Eigen::Index iterations = 0;
  const double gradients = best_of_three([&] {
    Eigen::ConjugateGradient<Matrix, Eigen::Lower | Eigen::Upper> solver;
    solver.setTolerance(1e-6);
    solver.compute(system);
    const Eigen::MatrixXd found = solver.solve(right);
    iterations = solver.iterations();
  });
  std::printf("Eigen, conjugate gradients: %.0f ms, %ld iterations\n", gradients, long(iterations));
  std::printf("Eigen, direct: %.0f ms\n", best_of_three([&] {
                const Eigen::SimplicialLDLT<Matrix> solver(system);
                const Eigen::MatrixXd found = solver.solve(right);
              }));
}

double stage_of(const pointfair::Report& report, const char* name) {
  for (const auto& stage : report.stages)
    if (stage.name == name) return stage.milliseconds;
  return 0;
}

void time_pointfair(const pointfair::Cloud& cloud, const pointfair::Params& params, const char* name) {
  double fairing = 1e30, total = 1e30;
  std::uint64_t iterations = 0;
  for (int i = 0; i < 3; ++i) {
    pointfair::Pipeline pipeline(pointfair::Device::cpu);
    pipeline.load(cloud);
    (void)pipeline.run(params);
    const pointfair::Report report = pipeline.report();
    fairing = std::min(fairing, stage_of(report, "fairing"));
    total = std::min(total, report.total_milliseconds);
    iterations = report.solver.iterations;
  }
  std::printf("pointfair, %s: fairing %.0f ms, whole run %.0f ms, %llu iterations\n", name, fairing, total,
              static_cast<unsigned long long>(iterations));
}

void compare(const std::string& path, double lambda) {
  const pointfair::Cloud cloud = pointfair::read(path);
  pointfair::Params params;
  params.connectivity = pointfair::Connectivity::mesh;
  params.tangential = 0;
  params.iterations = 1;
  time_pointfair(cloud, params, "bilateral");
  params.method = pointfair::Method::implicit;
  params.implicit_lambda = lambda;
  for (const auto weights : {pointfair::ImplicitWeights::uniform, pointfair::ImplicitWeights::curvature}) {
    params.implicit_weights = weights;
    time_pointfair(cloud, params, weights == pointfair::ImplicitWeights::uniform ? "uniform" : "curvature");
  }
  time_eigen(cloud, lambda);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) return std::fprintf(stderr, "usage: bench_implicit MESH [LAMBDA]\n"), 2;
  try {
    compare(argv[1], argc > 2 ? std::atof(argv[2]) : 10);
  } catch (const std::exception& error) {
    return std::fprintf(stderr, "%s\n", error.what()), 1;
  }
}
