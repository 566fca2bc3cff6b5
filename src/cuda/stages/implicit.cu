// SPDX-License-Identifier: Apache-2.0
// Conjugate gradients whose numbers stay on the card. The host starts some iterations at a time and then asks whether
// they were enough; those that were not needed do nothing.
#include <cmath>

#include "cuda/runtime/transfer.cuh"
#include "cuda/stages/faired_points.cuh"
#include "cuda/stages/implicit.cuh"
#include "cuda/stages/ordered_sum.cuh"
#include "cuda/stages/weighted_graph.cuh"
#include "seam/stop.hpp"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 128;
constexpr int kIterationsAtOnce = 8;

using point::Gradients, point::Place, point::SquaresLeft;

struct SolverState {
  Place whole, step, share;
  SquaresLeft left;
  unsigned long long iterations;
  bool done;
};

__device__ void put(Place p, double* numbers) { numbers[0] = p.x, numbers[1] = p.y, numbers[2] = p.z; }
__device__ void put(const SquaresLeft& squares, double* numbers) {
  put(squares.plain, numbers);
  put(squares.by_diagonal, numbers + 3);
}
__device__ Place place_at(const double* numbers) { return {numbers[0], numbers[1], numbers[2]}; }

// Sums of of(item) over each block of the sum.
template <int kSums, class Of>
__device__ void sum_block(std::size_t points, double* sums, const Of& of) {
  const SumRange range(points);
  const double sum = sum_in_order<kSums>(
      range.first, range.end, [&](std::size_t i, double* numbers) { put(of(static_cast<Index>(i)), numbers); });
  if (threadIdx.x < kSums) sums[std::size_t(blockIdx.x) * kSums + threadIdx.x] = sum;
}

__device__ SquaresLeft squares_of(const Totals<6>& sums) { return {place_at(sums.of), place_at(sums.of + 3)}; }
__device__ void look_whether_done(SolverState& state) {
  state.done =
      !(point::squared_residual(state.left.plain, state.whole) > point::kSolverResidual * point::kSolverResidual) ||
      state.iterations >= static_cast<unsigned long long>(point::kSolverIterations);
}

__global__ void __launch_bounds__(kSumThreads)
    start(const __grid_constant__ Tree tree, Gradients rows, std::size_t points, double* sums) {
  sum_block<6>(points, sums,
               [&](Index i) { return rows.start(i, [&](Index at) { return place_of(tree.points[at]); }); });
}
__global__ void __launch_bounds__(kSumThreads) note_start(const double* sums, std::size_t blocks, SolverState* state) {
  const Totals<6> all(sums, blocks);
  if (threadIdx.x != 0) return;
  state->left = squares_of(all);
  state->whole = state->left.plain;
  state->iterations = 0;
  look_whether_done(*state);
}

__global__ void __launch_bounds__(kSumThreads)
    multiply(Gradients rows, std::size_t points, const SolverState* state, double* sums) {
  if (state->done) return;
  sum_block<3>(points, sums, [&](Index i) { return rows.multiply(i); });
}
__global__ void __launch_bounds__(kSumThreads) note_step(const double* sums, std::size_t blocks, SolverState* state) {
  if (state->done) return;
  const Totals<3> all(sums, blocks);
  if (threadIdx.x == 0) state->step = point::quotient(state->left.by_diagonal, place_at(all.of));
}

__global__ void __launch_bounds__(kSumThreads)
    advance(Gradients rows, std::size_t points, const SolverState* state, double* sums) {
  if (state->done) return;
  const Place step = state->step;
  sum_block<6>(points, sums, [&](Index i) { return rows.advance(i, step); });
}
__global__ void __launch_bounds__(kSumThreads) note_left(const double* sums, std::size_t blocks, SolverState* state) {
  if (state->done) return;
  const Totals<6> all(sums, blocks);
  if (threadIdx.x != 0) return;
  const Place before = state->left.by_diagonal;
  state->left = squares_of(all);
  state->share = point::quotient(state->left.by_diagonal, before);
  ++state->iterations;
  look_whether_done(*state);
}

__global__ void __launch_bounds__(kBlock) turn(Gradients rows, std::size_t points, const SolverState* state) {
  if (state->done) return;
  const std::size_t i = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (i < points) rows.turn(static_cast<Index>(i), state->share);
}

__global__ void __launch_bounds__(kBlock)
    store(const __grid_constant__ Tree tree, const Place* displacements, double strength, FairedPoints faired) {
  const std::size_t at = std::size_t(blockIdx.x) * kBlock + threadIdx.x;  // whole leaves, so whole warps
  if (at >= std::size_t(tree.leaves) * kLeafSize) return;
  const float4 p = tree.points[at];
  const bool valid = is_present(p);
  store_faired(faired, at, p, valid, point::end_of(place_of(p), strength, displacements[at]));
}

class Solver {
 public:
  Solver(Context& context, const Tree& tree, const WeightedGraph& graph, double lambda)
      : context_(context),
        tree_(tree),
        points_(std::size_t(tree.leaves) * kLeafSize),
        blocks_(blocks_for(points_, point::kSumBlock)),
        places_(context),
        sums_(context),
        state_(context) {
    places_.resize(4 * points_);
    sums_.resize(std::size_t(6) * blocks_);
    state_.resize(1);
    Place* const first = places_.data();
    rows_ = {graph.view(), lambda, first, first + points_, first + 2 * points_, first + 3 * points_};
  }

  SolverReport solve(const std::stop_token& stop) {
    const cudaStream_t stream = context_.stream();
    // the host copies every byte
    state_.clear("solving for all points");
    start<<<blocks_, kSumThreads, 0, stream>>>(tree_, rows_, points_, sums_.data());
    note_start<<<1, kSumThreads, 0, stream>>>(sums_.data(), blocks_, state_.data());
    do {
      throw_if_stopped(stop);
      for (int i = 0; i < kIterationsAtOnce; ++i) iterate();
      state_.download({reached_.get(), 1}, "solving for all points");
      check(cudaStreamSynchronize(stream), "solving for all points");
    } while (!reached_.get()->done);
    const SolverState& reached = *reached_.get();
    return {reached.iterations, std::sqrt(point::squared_residual(reached.left.plain, reached.whole))};
  }

  const Place* displacements() const { return rows_.found; }

 private:
  void iterate() {
    const cudaStream_t stream = context_.stream();
    multiply<<<blocks_, kSumThreads, 0, stream>>>(rows_, points_, state_.data(), sums_.data());
    note_step<<<1, kSumThreads, 0, stream>>>(sums_.data(), blocks_, state_.data());
    advance<<<blocks_, kSumThreads, 0, stream>>>(rows_, points_, state_.data(), sums_.data());
    note_left<<<1, kSumThreads, 0, stream>>>(sums_.data(), blocks_, state_.data());
    launch(context_, "solving for all points", turn, blocks_for(points_, kBlock), kBlock, rows_, points_,
           state_.data());
  }

  Context& context_;
  const Tree& tree_;
  std::size_t points_;  // whole leaves
  unsigned blocks_;     // of sums
  DeviceArray<Place> places_;
  DeviceArray<double> sums_;
  DeviceArray<SolverState> state_;
  Pinned<SolverState> reached_;
  Gradients rows_{};
};

}  // namespace

SolverReport fair_implicitly(Context& context, const Tree& tree, const Lists& lists, const FairingSettings& settings,
                             const FairedPoints& faired, const std::stop_token& stop) {
  if (tree.leaves == 0) return {};
  const WeightedGraph graph(context, tree, lists, settings);
  Solver solver(context, tree, graph, settings.implicit_lambda * graph.lambda_unit());
  const SolverReport report = solver.solve(stop);
  launch(context, "fairing", store, blocks_for(std::size_t(tree.leaves) * kLeafSize, kBlock), kBlock, tree,
         solver.displacements(), settings.strength, faired);
  bring_into_order(context, faired);
  return report;
}

}  // namespace pointfair::cuda
