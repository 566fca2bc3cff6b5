// SPDX-License-Identifier: Apache-2.0
#include "cuda/runtime/launch.cuh"
#include "cuda/sampling/pools.cuh"
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

constexpr std::size_t kHead = point::kHeadRow, kNear = point::kNearRow;  // points
constexpr std::size_t kSpacingRow = point::kSpacingNeighbors + 1, kFirstRow = point::kFirstRow + 1,
                      kLastRow = point::kLastRow + 1;  // points
// Of each row: one a round, and after those of a first row two more, for its residuals, and one at its planes.
constexpr int kFirstLooks = point::kFirstRounds + 2, kLastLooks = point::kRounds - point::kFirstRounds;
constexpr int kFirstBlocks = kFirstLooks + 1;

template <int kMost>
__device__ point::Look look(point::FitSpace<kMost>& space, const Point* row, bool sheets, int points, bool always) {
  const point::RowTaken taken = point::take_row(WarpTeam{}, space, row);
  point::GrowingNeighborhood<WarpTeam, kMost> neighborhood(WarpTeam{}, space, sheets);
  return point::look_at(neighborhood, taken, points, always);
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
    const bool is_near = samples.near != nullptr && sample < std::size_t(point::kNearRows);
    for (std::size_t i = lane_number(); i < kNear && is_near; i += kWarp) samples.near[sample * kNear + i] = row[i];
    const point::RowTaken taken = point::take_row(WarpTeam{}, space, row);
    const point::PlaneSample planes = point::plane_sample(WarpTeam{}, space, taken.there);
    if (lane_number() == 0) to.planes[sample] = planes;
    return;
  }
  const int points = round < point::kFirstRounds    ? point::points_of(round)
                     : round == point::kFirstRounds ? 2 * point::kFirstFit
                                                    : point::kLeastFit;
  const bool for_residuals = round == 0 || round >= point::kFirstRounds - 1;
  const point::Look found = look(space, row, samples.rule.sheets, points, for_residuals);
  if (lane_number() == 0) to.looks[sample * kFirstLooks + round] = found;
}

__global__ void __launch_bounds__(kWarp)
    look_at_last_rows(const Point* rows, const Index* again, bool sheets, point::Look* looks) {
  __shared__ point::FitSpace<point::kLastRow> space;
  begin_kernel();
  const std::size_t n = blockIdx.x / kLastLooks;
  if (again[n] == point::kNoNeighbor) return;
  const int points = point::points_of(point::kFirstRounds + static_cast<int>(blockIdx.x % kLastLooks));
  const point::Look found = look(space, rows + n * kLastRow, sheets, points, false);
  if (lane_number() == 0) looks[blockIdx.x] = found;
}

// `again`: the queries whose first row is too short, or none; `shows`: whether samples show noise.
__global__ void __launch_bounds__(kBlock)
    conclude_first(SampleArrays samples, FirstLooks from, Index* again, unsigned char* shows) {
  begin_kernel();
  const std::size_t n = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (n >= samples.for_noise) return;
  const point::Look* const its = from.looks + n * kFirstLooks;
  const point::NoiseSample noise = point::noise_sample(0, point::kFirstRounds, [its](int round) { return its[round]; });
  samples.noise[n] = noise;
  shows[n] = noise.shows_noise;
  samples.residuals[n] = point::residual_sample(its[point::kFirstRounds + 1], its[0], its[point::kFirstRounds],
                                                its[point::kFirstRounds - 1], from.planes[n]);
  again[n] = noise.is_short ? samples.queries[samples.for_spacing + n] : point::kNoNeighbor;
}

__global__ void __launch_bounds__(kBlock)
    conclude_last(SampleArrays samples, const Index* again, const point::Look* looks, unsigned char* shows) {
  begin_kernel();
  const std::size_t n = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (n >= samples.for_noise || again[n] == point::kNoNeighbor) return;
  const point::Look* const its = looks + n * kLastLooks;
  const point::NoiseSample noise = point::noise_sample(point::kFirstRounds, point::kRounds,
                                                       [its](int round) { return its[round - point::kFirstRounds]; });
  samples.noise[n] = noise;
  shows[n] = noise.shows_noise;
}

// The looks of a sample in the order in which its neighbourhood grows, and what they are for.
constexpr int kSteps = point::kFirstRounds + 2, kLeast = 0, kNarrow = 1, kWide = 4, kWidest = kSteps - 1;
__device__ __forceinline__ int step_of_round(int round) { return round < 3 ? round + 1 : round + 2; }
__device__ __forceinline__ int points_of_step(int step) {
  if (step == kLeast) return point::kLeastFit;
  if (step == kWide) return 2 * point::kFirstFit;
  return point::points_of(step < kWide ? step - 1 : step - 2);
}
static_assert(point::points_of(2) < 2 * point::kFirstFit && 2 * point::kFirstFit < point::points_of(3));

// A warp to each sample, which looks at no more than it needs: where there are many samples. One loop, since the code
// of a look is long.
__global__ void __launch_bounds__(kWarp)
    look_at_samples(const Point* rows, point::NoiseSample* noise, point::ResidualSample* residuals, Point* heads) {
  __shared__ point::FitSpace<point::kFirstRow> space;
  __shared__ point::Look looks[kSteps];
  begin_kernel();
  const std::size_t n = blockIdx.x;
  const Point* const row = rows + n * kFirstRow;
  if (lane_number() < kHead) heads[n * kHead + lane_number()] = row[lane_number()];
  const point::RowTaken taken = point::take_row(WarpTeam{}, space, row);
  point::GrowingNeighborhood<WarpTeam, point::kFirstRow> neighborhood(WarpTeam{}, space, false);
  bool suffices = false;
#pragma unroll 1
  for (int step = 0; step < kSteps; ++step) {
    const bool for_residuals = step == kLeast || step == kNarrow || step == kWide || step == kWidest;
    if (suffices && !for_residuals) continue;
    const point::Look found = point::look_at(neighborhood, taken, points_of_step(step), for_residuals);
    suffices = suffices || (step != kLeast && step != kWide && (found.is_wide || found.is_last));
    if (lane_number() == 0) looks[step] = found;
  }
  const point::PlaneSample planes = point::plane_sample(WarpTeam{}, space, taken.there);
  if (lane_number() != 0) return;
  noise[n] = point::noise_sample(0, point::kFirstRounds, [](int round) { return looks[step_of_round(round)]; });
  residuals[n] = point::residual_sample(looks[kLeast], looks[kNarrow], looks[kWide], looks[kWidest], planes);
}

__global__ void __launch_bounds__(kBlock)
    find_spacings(const Point* rows, std::size_t count, point::SpacingSample* samples) {
  begin_kernel();
  const std::size_t n = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (n < count) samples[n] = point::spacing_sample(rows + n * kSpacingRow);
}

__global__ void __launch_bounds__(kBlock)
    conclude_longer(std::size_t count, const point::Look* looks, point::NoiseSample* noise) {
  begin_kernel();
  const std::size_t n = std::size_t(blockIdx.x) * kBlock + threadIdx.x;
  if (n >= count) return;
  const point::Look* const its = looks + n * kLastLooks;
  noise[n] = point::noise_sample(point::kFirstRounds, point::kRounds,
                                 [its](int round) { return its[round - point::kFirstRounds]; });
}

template <class Kernel, class... Arguments>
void start(Context& context, Kernel kernel, std::size_t blocks, int threads, Arguments... arguments) {
  if (blocks > 0) launch_early(context, "taking samples", kernel, unsigned(blocks), unsigned(threads), arguments...);
}

}  // namespace

void take_samples(Context& context, const Tree& tree, const Point* points, const ManyQueries& queries,
                  const ManySamples& samples) {
  DeviceArray<Point> spacing_rows(context), rows(context);
  spacing_rows.resize(queries.for_spacing * kSpacingRow);
  rows.resize(queries.for_noise * kFirstRow);
  RowRequest few{queries.spacing, queries.for_spacing, point::kSpacingNeighbors, spacing_rows.data()},
      many{queries.noise, queries.for_noise, point::kFirstRow, rows.data()};
  few.clouds = queries.clouds_of_spacing;
  many.clouds = queries.clouds_of_noise;
  find_rows(context, tree, points, few, many);
  start(context, find_spacings, queries.for_spacing > 0 ? blocks_for(queries.for_spacing, kBlock) : 0, kBlock,
        static_cast<const Point*>(spacing_rows.data()), queries.for_spacing, samples.spacing);
  start(context, look_at_samples, queries.for_noise, kWarp, static_cast<const Point*>(rows.data()), samples.noise,
        samples.residuals, samples.heads);
}

void look_farther(Context& context, const Tree& tree, const Point* points, const Index* queries, const Index* clouds,
                  std::size_t count, point::NoiseSample* noise) {
  if (count == 0) return;
  DeviceArray<Point> rows(context);
  DeviceArray<point::Look> looks(context);
  rows.resize(count * kLastRow);
  looks.resize(count * kLastLooks);
  RowRequest request{queries, count, point::kLastRow, rows.data()};
  request.clouds = clouds;
  find_rows(context, tree, points, {}, request);
  start(context, look_at_last_rows, count * kLastLooks, kWarp, static_cast<const Point*>(rows.data()), queries, false,
        looks.data());
  start(context, conclude_longer, blocks_for(count, kBlock), kBlock, count,
        static_cast<const point::Look*>(looks.data()), noise);
}

void take_samples(Context& context, const Tree& tree, const Point* points, const SampleArrays& samples) {
  const std::size_t spacings = samples.for_spacing, noises = samples.for_noise;
  DeviceArray<Point> spacing_rows(context), first_rows(context), last_rows(context);
  DeviceArray<point::Look> first_looks(context), last_looks(context);
  DeviceArray<point::PlaneSample> planes(context);
  DeviceArray<Index> again(context);
  DeviceArray<unsigned char> shows(context);
  spacing_rows.resize(spacings * kSpacingRow);
  first_rows.resize(noises * kFirstRow);
  last_rows.resize(noises * kLastRow);
  first_looks.resize(noises * kFirstLooks);
  last_looks.resize(noises * kLastLooks);
  planes.resize(noises);
  again.resize(noises);
  shows.resize(noises);
  const SampleRule rule = samples.rule;
  RowRequest first{samples.queries + spacings, noises, point::kFirstRow, first_rows.data()},
      last{again.data(), noises, point::kLastRow, last_rows.data(), first_rows.data(), point::kFirstRow};
  first.stride = last.stride = rule.stride;
  find_rows(context, tree, points, {samples.queries, spacings, point::kSpacingNeighbors, spacing_rows.data()}, first);
  const FirstLooks seen{first_looks.data(), planes.data()};
  start(context, look_at_first_rows, noises * kFirstBlocks + (spacings + kWarp - 1) / kWarp, kWarp, samples,
        spacing_rows.data(), first_rows.data(), seen);
  if (noises == 0) return;
  start(context, conclude_first, blocks_for(noises, kBlock), kBlock, samples, seen, again.data(), shows.data());
  find_rows(context, tree, points, {}, last);
  start(context, look_at_last_rows, noises * kLastLooks, kWarp, last_rows.data(), again.data(), rule.sheets,
        last_looks.data());
  start(context, conclude_last, blocks_for(noises, kBlock), kBlock, samples, again.data(), last_looks.data(),
        shows.data());
  if (samples.pools != nullptr) find_pools(context, first_rows.data(), kFirstRow, shows.data(), noises, samples.pools);
}

}  // namespace pointfair::cuda
