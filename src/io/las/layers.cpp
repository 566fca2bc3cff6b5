// SPDX-License-Identifier: Apache-2.0
#include "io/las/layers.hpp"

#include <cstdlib>
#include <memory>

#include "io/las/header.hpp"
#include "io/las/integer_coder.hpp"

namespace pointfair::io::las {
namespace {

// Six contexts for a point's place among its pulse's returns: row = number of returns, column = number of this one.
constexpr std::array<std::string_view, 16> kReturnContexts = {
    "0123453445555555", "1013333333333333", "2124444444433333", "3345444444444444",
    "4344544444444444", "5344454444444444", "3344445444444444", "4344444544444444",
    "4344444454444444", "5344444445444444", "5344444444544444", "5334444444455444",
    "5334444444455544", "5334444444445554", "5334444444444555", "5334444444444455"};

// What the coding of one scanner channel remembers.
struct Channel {
  Grid last{};
  std::uint32_t last_number = 0, last_count = 0;
  bool last_time_changed = false;
  std::array<RunningMedian, 12> x_steps, y_steps;
  std::array<std::int32_t, 8> last_z{};
  std::vector<SymbolModel> changes = std::vector(8, SymbolModel(128));
  SymbolModel other_channel{3}, number_step{13};
  std::vector<SymbolModel> counts = std::vector(16, SymbolModel(16)), numbers = std::vector(16, SymbolModel(16));
  IntegerCoder x{2}, y{22}, z{20};
};

// One point after the other, in either direction: with Decoders `grid` and `returns` are filled, with Encoders read.
template <class Coder>
class PointCoder {
 public:
  /// `z` may be null: then all points have the first one's Z.
  PointCoder(Coder& xy, Coder* z, const Grid& first, Returns returns) : xy_(xy), z_(z), current_(returns.channel) {
    begin_channel(current_, first, returns.number, returns.count);
  }

  void code(Grid& grid, Returns& returns) {
    code_returns(returns);
    Channel& channel = *channels_[current_];
    const std::uint32_t number = returns.number, count = returns.count, single = count == 1;
    const auto context = static_cast<std::uint32_t>(2 * (kReturnContexts[count][number] - '0') + returns.time_changed);

    code_along(xy_, channel.x, channel.x_steps[context], channel.last[0], grid[0], single);
    code_along(xy_, channel.y, channel.y_steps[context], channel.last[1], grid[1],
               single + even(channel.x.last_size(), 20));
    std::int32_t& last_z = channel.last_z[static_cast<std::size_t>(std::min(7, std::abs(int(count) - int(number))))];
    if (z_) {
      const std::uint32_t size = (channel.x.last_size() + channel.y.last_size()) / 2;
      last_z = channel.z.code(*z_, last_z, grid[2], single + even(size, 18));
    }
    grid[2] = last_z;
    channel.last = grid;
  }

 private:
  // A channel that was not seen yet begins where the last point of the other one is.
  void begin_channel(std::uint32_t channel, const Grid& last, std::uint32_t number, std::uint32_t count) {
    channels_[channel] = std::make_unique<Channel>();
    Channel& made = *channels_[channel];
    made.last = last;
    made.last_number = number;
    made.last_count = count;
    made.last_z.fill(last[2]);
  }

  void code_returns(Returns& returns) {
    Channel& before = *channels_[current_];
    const std::uint32_t place = (before.last_number == 1) | (before.last_number >= before.last_count) << 1 |
                                std::uint32_t{before.last_time_changed} << 2;
    const Channel& last = channels_[returns.channel] ? *channels_[returns.channel] : before;
    const std::uint32_t changes = xy_.code(before.changes[place], changes_of(last, returns));
    if ((changes & kChannel) != 0) change_channel(returns);
    returns.channel = static_cast<std::uint16_t>(current_ & 3);
    Channel& channel = *channels_[current_];
    returns.source_changed = (changes & kSource) != 0;
    returns.time_changed = (changes & kTime) != 0;
    returns.angle_changed = (changes & kAngle) != 0;
    code_numbers(channel, changes, returns);
    channel.last_number = returns.number;
    channel.last_count = returns.count;
    channel.last_time_changed = returns.time_changed;
  }

  static constexpr std::uint32_t kCount = 4, kAngle = 8, kTime = 16, kSource = 32, kChannel = 64;
  static constexpr std::uint32_t kSame = 0, kNext = 1, kPrevious = 2, kOther = 3;  // number of the return

  std::uint32_t changes_of(const Channel& last, Returns returns) const {
    const std::uint32_t step = (returns.number - last.last_number) & 15U;
    const std::uint32_t number = step == 0 ? kSame : step == 1 ? kNext : step == 15 ? kPrevious : kOther;
    return number | (returns.count != last.last_count ? kCount : 0) | (returns.angle_changed ? kAngle : 0) |
           (returns.time_changed ? kTime : 0) | (returns.source_changed ? kSource : 0) |
           (returns.channel != current_ ? kChannel : 0);
  }

  void change_channel(Returns returns) {
    Channel& before = *channels_[current_];
    const std::uint32_t step = xy_.code(before.other_channel, (returns.channel - current_ - 1) & 3U);
    const std::uint32_t now = (current_ + step + 1) & 3;
    if (!channels_[now]) begin_channel(now, before.last, before.last_number, before.last_count);
    current_ = now;
  }

  void code_numbers(Channel& channel, std::uint32_t changes, Returns& returns) {
    const std::uint32_t last_number = channel.last_number, last_count = channel.last_count;
    std::uint32_t number = last_number, count = last_count;
    if ((changes & kCount) != 0) count = xy_.code(channel.counts[last_count], returns.count);
    switch (changes & 3) {
      case kNext:
        number += 1;
        break;
      case kPrevious:
        number += 15;
        break;
      case kOther:
        number = returns.time_changed
                     ? xy_.code(channel.numbers[last_number], returns.number)
                     : last_number + 2 + xy_.code(channel.number_step, (returns.number - last_number - 2) & 15U);
        break;
      default:
        break;
    }
    returns.number = static_cast<std::uint16_t>(number & 15);
    returns.count = static_cast<std::uint16_t>(count & 15);
  }

  Coder& xy_;
  Coder* z_;
  std::array<std::unique_ptr<Channel>, 4> channels_;
  std::uint32_t current_;
};

Returns first_returns(const LayeredChunk& chunk) {
  const unsigned numbers = load_little<std::uint8_t>(chunk.first_point.data() + 14);
  const unsigned flags = load_little<std::uint8_t>(chunk.first_point.data() + 15);
  Returns returns{};
  returns.number = numbers & 15U;
  returns.count = (numbers >> 4) & 15U;
  returns.channel = (flags >> 4) & 3U;
  return returns;
}

}  // namespace

std::optional<LayeredChunk> split_layers(std::string_view chunk, std::size_t record_length, std::size_t layers,
                                         std::uint32_t points) {
  const std::size_t head = record_length + 4 + 4 * layers;
  if (layers < 2 || chunk.size() < head) return std::nullopt;
  LayeredChunk result;
  result.first_point = chunk.substr(0, record_length);
  result.sizes = chunk.substr(record_length + 4, 4 * layers);
  if (load_little<std::uint32_t>(chunk.data() + record_length) != points) return std::nullopt;
  std::string_view rest = chunk.substr(head);
  for (std::size_t layer = 0; layer < layers; ++layer) {
    const std::size_t size = load_little<std::uint32_t>(result.sizes.data() + 4 * layer);
    if (size > rest.size() || is_impossible_code(rest.substr(0, size))) return std::nullopt;
    if (layer == 0) result.returns_xy = rest.substr(0, size);
    if (layer == 1) result.z = rest.substr(0, size);
    if (layer == 2) result.others = rest;
    rest.remove_prefix(size);
  }
  return result;
}

bool decode_layers(const LayeredChunk& chunk, std::span<Grid> points, std::span<Returns> returns) {
  points[0] = get_grid(chunk.first_point.data());
  returns[0] = first_returns(chunk);
  Decoder xy(chunk.returns_xy), z(chunk.z);
  PointCoder<Decoder> coder(xy, chunk.z.empty() ? nullptr : &z, points[0], returns[0]);
  for (std::size_t i = 1; i < points.size(); ++i) {
    coder.code(points[i], returns[i]);
    if (xy.overrun() || (!chunk.z.empty() && z.overrun())) return false;
  }
  return true;
}

CoordinateCodes encode_coordinates(std::span<const Grid> points, std::span<const Returns> returns) {
  CoordinateCodes codes;
  codes.returns_xy.reserve(5 * points.size() + 64);
  codes.z.reserve(3 * points.size() + 64);
  Encoder xy(codes.returns_xy), z(codes.z);
  PointCoder<Encoder> coder(xy, &z, points[0], returns[0]);
  for (std::size_t i = 1; i < points.size(); ++i) {
    Grid grid = points[i];
    Returns same = returns[i];
    coder.code(grid, same);
  }
  xy.finish();
  z.finish();
  return codes;
}

void encode_layers(const LayeredChunk& chunk, std::span<const Grid> points, std::span<const Returns> returns,
                   std::string& to) {
  const CoordinateCodes codes = encode_coordinates(points, returns);
  const std::size_t begin = to.size();
  to.append(chunk.first_point);
  put_grid(points[0], to.data() + begin);
  append_little<std::uint32_t>(to, static_cast<std::uint32_t>(points.size()));
  append_little<std::uint32_t>(to, static_cast<std::uint32_t>(codes.returns_xy.size()));
  append_little<std::uint32_t>(to, static_cast<std::uint32_t>(codes.z.size()));
  to.append(chunk.sizes.substr(8)).append(codes.returns_xy).append(codes.z).append(chunk.others);
}

}  // namespace pointfair::io::las
