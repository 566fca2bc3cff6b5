// SPDX-License-Identifier: Apache-2.0
#include "cuda/runtime/launch.cuh"
#include "cuda/sampling/samples.cuh"

namespace pointfair::cuda {
namespace {

constexpr int kBlock = 64;

// A warp as a team of point/surface_fit.h, a lane to each stride.
static_assert(point::kStrides == kWarp);
struct WarpTeam {
  template <class Body>
  __device__ __forceinline__ void for_each(int count, const Body& body) const {
    __syncwarp();  // all have read what is written now
    for (int i = static_cast<int>(lane_number()); i < count; i += kWarp) body(i);
    __syncwarp();
  }

  template <int N>
  class Sums {
   public:
    __device__ __forceinline__ explicit Sums(WarpTeam) {}
    template <class TermsOf>
    __device__ __forceinline__ void add(int first, int end, const TermsOf& terms_of) {
      const int lane = static_cast<int>(lane_number());
#pragma unroll(kUnroll)
      for (int i = first + (lane - first & (kWarp - 1)); i < end; i += kWarp) {
        const point::Terms<N> terms = terms_of(i);
        point::for_constants<N>([&](auto n) { partial_.of[n.value] += terms.of[n.value]; });
      }
    }
    __device__ __forceinline__ point::Terms<N> total() const {
      point::Terms<N> total = partial_;
#pragma unroll(kUnroll)
      for (int half = kWarp / 2; half > 0; half /= 2)
        point::for_constants<N>(
            [&](auto n) { total.of[n.value] += __shfl_xor_sync(kAllLanes, total.of[n.value], half); });
      return total;
    }

   private:
    static constexpr int kUnroll = N > 16 ? 1 : 5;  // of many sums once is code enough
    point::Terms<N> partial_{};
  };
};

constexpr std::size_t kSpacingRow = point::kSpacingNeighbors + 1, kFirstRow = point::kFirstRow + 1,
                      kLastRow = point::kLastRow + 1;  // points
// Of each row: one a round, and after those of a first row two more, for its residuals, and one at its planes.
constexpr int kFirstLooks = point::kFirstRounds + 2, kLastLooks = point::kRounds - point::kFirstRounds;
constexpr int kFirstBlocks = kFirstLooks + 1;

template <int kMost>
__device__ point::Look look(point::FitSpace<kMost>& space, const Point* row, int points, bool always) {
  const int there = point::take_row(WarpTeam{}, space, row, points);
  point::GrowingNeighborhood<WarpTeam, kMost> neighborhood(WarpTeam{}, space);
  return point::look_at(neighborhood, there, points, always);
}

// What is seen at first rows, before it is put together.
struct FirstLooks {
  point::Look* looks;  // kFirstLooks of each row
  point::PlaneSample* planes;
};

// A block to each look, so that no round waits for the one before, then one to kWarp samples of the spacing.
__global__ void __launch_bounds__(kWarp)
    look_at_first_rows(SampleArrays samples, const Point* spacing_rows, const Point* rows, FirstLooks to) {
  __shared__ point::FitSpace<point::kFirstRow> space;
  begin_kernel();
  const std::size_t all_looks = samples.for_noise * kFirstBlocks;
  if (blockIdx.x >= all_looks) {
    const std::size_t n = (blockIdx.x - all_looks) * kWarp + lane_number();
    if (n < samples.for_spacing) samples.spacing[n] = point::spacing_sample(spacing_rows + n * kSpacingRow);
    return;
  }
  const std::size_t sample = blockIdx.x / kFirstBlocks;
  const int round = static_cast<int>(blockIdx.x % kFirstBlocks);
  const Point* const row = rows + sample * kFirstRow;
  if (round == kFirstLooks) {
    const int there = point::take_row(WarpTeam{}, space, row, point::kFirstRow);
    const point::PlaneSample planes = point::plane_sample(WarpTeam{}, space, there);
    if (lane_number() == 0) to.planes[sample] = planes;
    return;
  }
  const int points = round < point::kFirstRounds    ? point::points_of(round)
                     : round == point::kFirstRounds ? 2 * point::kFirstFit
                                                    : point::kLeastFit;
  const bool for_residuals = round == 0 || round >= point::kFirstRounds - 1;
  const point::Look found = look(space, row, points, for_residuals);
  if (lane_number() == 0) to.looks[sample * kFirstLooks + round] = found;
}

__global__ void __launch_bounds__(kWarp) look_at_last_rows(const Point* rows, const Index* again, point::Look* looks) {
  __shared__ point::FitSpace<point::kLastRow> space;
  begin_kernel();
  const std::size_t n = blockIdx.x / kLastLooks;
  if (again[n] == point::kNoNeighbor) return;
  const int points = point::points_of(point::kFirstRounds + static_cast<int>(blockIdx.x % kLastLooks));
  const point::Look found = look(space, rows + n * kLastRow, points, false);
  if (lane_number() == 0) looks[blockIdx.x] = found;
}

// `again`: the queries whose first row is too short, or none.
__global__ void __launch_bounds__(kBlock) conclude_first(SampleArrays samples, FirstLooks from, Index* again) {
  begin_kernel();
  const std::size_t n = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (n >= samples.for_noise) return;
  const point::Look* const its = from.looks + n * kFirstLooks;
  const point::NoiseSample noise = point::noise_sample(0, point::kFirstRounds, [its](int round) { return its[round]; });
  samples.noise[n] = noise;
  samples.residuals[n] = point::residual_sample(its[point::kFirstRounds + 1], its[0], its[point::kFirstRounds],
                                                its[point::kFirstRounds - 1], from.planes[n]);
  again[n] = noise.is_short ? samples.queries[samples.for_spacing + n] : point::kNoNeighbor;
}

__global__ void __launch_bounds__(kBlock)
    conclude_last(SampleArrays samples, const Index* again, const point::Look* looks) {
  begin_kernel();
  const std::size_t n = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (n >= samples.for_noise || again[n] == point::kNoNeighbor) return;
  const point::Look* const its = looks + n * kLastLooks;
  samples.noise[n] = point::noise_sample(point::kFirstRounds, point::kRounds,
                                         [its](int round) { return its[round - point::kFirstRounds]; });
}

}  // namespace

void take_samples(Context& context, const Tree& tree, const Point* points, const SampleArrays& samples) {
  const std::size_t spacings = samples.for_spacing, noises = samples.for_noise;
  DeviceArray<Point> spacing_rows(context), first_rows(context), last_rows(context);
  DeviceArray<point::Look> first_looks(context), last_looks(context);
  DeviceArray<point::PlaneSample> planes(context);
  DeviceArray<Index> again(context);
  spacing_rows.resize(spacings * kSpacingRow);
  first_rows.resize(noises * kFirstRow);
  last_rows.resize(noises * kLastRow);
  first_looks.resize(noises * kFirstLooks);
  last_looks.resize(noises * kLastLooks);
  planes.resize(noises);
  again.resize(noises);
  const auto start = [&context](auto kernel, std::size_t blocks, int threads, auto... arguments) {
    if (blocks > 0) launch_early(context, "taking samples", kernel, unsigned(blocks), unsigned(threads), arguments...);
  };
  find_rows(context, tree, points, {samples.queries, spacings, point::kSpacingNeighbors, spacing_rows.data()},
            {samples.queries + spacings, noises, point::kFirstRow, first_rows.data()});
  const FirstLooks seen{first_looks.data(), planes.data()};
  start(look_at_first_rows, noises * kFirstBlocks + (spacings + kWarp - 1) / kWarp, kWarp, samples, spacing_rows.data(),
        first_rows.data(), seen);
  if (noises == 0) return;
  start(conclude_first, blocks_for(noises, kBlock), kBlock, samples, seen, again.data());
  find_rows(context, tree, points, {},
            {again.data(), noises, point::kLastRow, last_rows.data(), first_rows.data(), point::kFirstRow});
  start(look_at_last_rows, noises * kLastLooks, kWarp, last_rows.data(), again.data(), last_looks.data());
  start(conclude_last, blocks_for(noises, kBlock), kBlock, samples, again.data(), last_looks.data());
}

}  // namespace pointfair::cuda
