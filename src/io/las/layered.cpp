// SPDX-License-Identifier: Apache-2.0
#include "io/las/layered.hpp"

#include <algorithm>
#include <array>
#include <memory>
#include <vector>

#include "io/las/layer_models.hpp"

namespace pointfair::io::las {
namespace {

using namespace layer_models;

// Where the fields of item POINT14 are in a record.
constexpr std::size_t kIntensity = 12, kNumbers = 14, kFlags = 15, kClass = 16, kUser = 17, kAngle = 18, kSource = 20,
                      kTime = 22;

enum class Part {
  classification,
  flags,
  intensity,
  scan_angle,
  user_data,
  point_source,
  time,
  color,
  near_infrared,
  wave,
  extra_byte
};

struct Layer {
  Part part{};
  ByteRange bytes;  // of the record

  bool is_of_point() const { return part < Part::color; }
};

// All behind those of the coordinates, in their order.
std::vector<Layer> layers_of(const Compression& compression) {
  std::vector<Layer> layers = {{Part::classification, {kClass, kClass + 1}},
                               {Part::flags, {kFlags, kFlags + 1}},
                               {Part::intensity, {kIntensity, kIntensity + 2}},
                               {Part::scan_angle, {kAngle, kAngle + 2}},
                               {Part::user_data, {kUser, kUser + 1}},
                               {Part::point_source, {kSource, kSource + 2}},
                               {Part::time, {kTime, kTime + 8}}};
  std::size_t at = 0;
  for (const Item& item : compression.items) {
    const bool has_near_infrared = item.type == Item::color_nir14;
    if (item.type == Item::color14 || has_near_infrared) layers.push_back({Part::color, {at, at + 6}});
    if (has_near_infrared) layers.push_back({Part::near_infrared, {at + 6, at + 8}});
    if (item.type == Item::wave14) layers.push_back({Part::wave, {at, at + item.size}});
    for (std::size_t i = 0; item.type == Item::bytes14 && i < item.size; ++i)
      layers.push_back({Part::extra_byte, {at + i, at + i + 1}});
    at += item.size;
  }
  return layers;
}

// Which scanner channel's models code a point, and from which channel's last value.
struct Turn {
  std::uint8_t models = 0, last = 0;
  bool begins = false;      // the models' channel was not seen yet: it goes on from the value of `before`
  std::uint8_t before = 0;  // the channel of the point before
};

class Turns {
 public:
  explicit Turns(std::uint32_t first) : current_(static_cast<std::uint8_t>(first)) { seen_[current_] = true; }

  /// `keeps_last`: a channel that was seen before goes on from the last value of the channel before.
  Turn next(std::uint32_t channel, bool keeps_last) {
    Turn turn{static_cast<std::uint8_t>(channel), static_cast<std::uint8_t>(channel), !seen_[channel], current_};
    if (keeps_last && !turn.begins) turn.last = current_;
    seen_[channel] = true;
    current_ = turn.models;
    return turn;
  }

 private:
  std::array<bool, 4> seen_{};
  std::uint8_t current_;
};

std::vector<Turn> turns_of_point(std::span<const Returns> returns) {
  Turns turns(returns[0].channel);
  std::vector<Turn> result(returns.size());
  for (std::size_t i = 1; i < returns.size(); ++i) result[i] = turns.next(returns[i].channel, false);
  result[0].models = static_cast<std::uint8_t>(returns[0].channel);
  return result;
}

// Version 3 of the other items goes by what LASzip did before it was mended in version 4: these items see the scanner
// channel only of a point where it changes, else 0, and a change does not change the last value.
std::vector<Turn> turns_of_items(std::span<const Returns> returns, unsigned version) {
  if (version != 3) return turns_of_point(returns);
  Turns turns(returns[0].channel);
  std::vector<Turn> result(returns.size());
  for (std::size_t i = 1; i < returns.size(); ++i) {
    const std::uint32_t channel = returns[i].channel;
    result[i] = turns.next(channel != returns[i - 1].channel ? channel : 0, true);
  }
  result[0].models = static_cast<std::uint8_t>(returns[0].channel);
  return result;
}

// Calls `visit` with the type of what codes such a layer.
template <class Visit>
auto with_models(Part part, const Visit& visit) {
  switch (part) {
    case Part::classification:
      return visit.template operator()<Classifications>();
    case Part::flags:
      return visit.template operator()<Flags>();
    case Part::intensity:
      return visit.template operator()<Intensities>();
    case Part::scan_angle:
      return visit.template operator()<ScanAngles>();
    case Part::user_data:
      return visit.template operator()<UserData>();
    case Part::point_source:
      return visit.template operator()<PointSources>();
    case Part::time:
      return visit.template operator()<Times>();
    case Part::color:
      return visit.template operator()<Colors>();
    case Part::near_infrared:
      return visit.template operator()<NearInfrared>();
    case Part::wave:
      return visit.template operator()<Waves>();
    default:
      return visit.template operator()<ExtraBytes>();
  }
}

// The values of a layer in records of `length` bytes, of which `values` is the first; that one is known.
struct Values {
  char* values;
  std::size_t length;
};

// Codes the values of all points. False: the bytes are damaged.
template <class Models, class Coder>
bool code_values(Coder& coder, std::span<const Returns> returns, std::span<const Turn> turns, const Values& of) {
  std::array<std::unique_ptr<Models>, 4> models;
  std::array<std::array<char, Models::kSize>, 4> last;
  char* value = of.values;
  models[turns[0].models] = std::make_unique<Models>(value);
  std::copy_n(value, Models::kSize, last[turns[0].models].data());
  for (std::size_t i = 1; i < returns.size(); ++i) {
    value += of.length;
    const Turn turn = turns[i];
    if (turn.begins) {
      last[turn.models] = last[turn.before];
      models[turn.models] = std::make_unique<Models>(last[turn.models].data());
    }
    models[turn.models]->code(coder, returns[i], last[turn.last].data(), value);
    std::copy_n(value, Models::kSize, last[turn.last].data());
  }
  if constexpr (requires(const Models& made) { made.is_damaged(); }) {
    for (const auto& made : models)
      if (made && made->is_damaged()) return false;
  }
  return true;
}

// A layer without a code has the first point's value everywhere.
void repeat_first(const Layer& layer, std::span<const Returns> returns, const Values& of) {
  char* value = of.values;
  for (std::size_t i = 1; i < returns.size(); ++i) {
    value += of.length;
    std::copy_n(of.values, layer.bytes.end - layer.bytes.begin, value);
    if (layer.part == Part::flags) *value = static_cast<char>((byte(*value) & 0xCF) | returns[i].channel << 4);
  }
}

bool changes(const Layer& layer, std::span<const Returns> returns, const Values& of) {
  if (layer.part == Part::time)
    return std::any_of(returns.begin(), returns.end(), [](Returns of_point) { return of_point.time_changed; });
  const std::size_t size = layer.bytes.end - layer.bytes.begin;
  const char *value = of.values, *const first = of.values;
  const bool is_colored = layer.part == Part::color && !(std::equal(first, first + 4, first + 2));
  for (std::size_t i = 1; i < returns.size(); ++i) {
    value += of.length;
    const bool same =
        layer.part == Part::flags ? Flags::of(*value) == Flags::of(*first) : std::equal(first, first + size, value);
    if (!same || is_colored) return true;
  }
  return false;
}

// What the records say of returns, and what changes against the last point of the scanner channel.
std::vector<Returns> returns_of(std::span<const char> records, std::size_t length) {
  const auto has_other_time = [](const char* a, const char* b) {
    // as numbers, too: LASzip takes a time that is no number for another one than itself
    return load_little<double>(a + kTime) != load_little<double>(b + kTime) ||
           !std::equal(a + kTime, a + kTime + 8, b + kTime);
  };
  std::vector<Returns> result(records.size() / length);
  std::array<const char*, 4> last{};
  const char* before = nullptr;
  for (std::size_t i = 0; i < result.size(); ++i) {
    const char* const record = records.data() + i * length;
    Returns& now = result[i];
    now = {};
    now.number = byte(record[kNumbers]) & 15U;
    now.count = (byte(record[kNumbers]) >> 4) & 15U;
    now.channel = (byte(record[kFlags]) >> 4) & 3U;
    if (const char* const other = last[now.channel] ? last[now.channel] : before) {
      now.time_changed = has_other_time(record, other);
      now.angle_changed = !std::equal(record + kAngle, record + kAngle + 2, other + kAngle);
      now.source_changed = !std::equal(record + kSource, record + kSource + 2, other + kSource);
    }
    last[now.channel] = before = record;
  }
  return result;
}

std::string encode_values(const Layer& layer, std::span<const Returns> returns, std::span<const Turn> turns,
                          const Values& of) {
  std::string code;
  if (!changes(layer, returns, of)) return code;
  code.reserve(returns.size() / 2);
  Encoder encoder(code);
  with_models(layer.part, [&]<class Models>() { code_values<Models>(encoder, returns, turns, of); });
  encoder.finish();
  return code;
}

}  // namespace

bool decode_layered(const Compression& compression, const LayeredChunk& chunk, std::span<const Returns> returns,
                    ByteRange wanted, std::span<char> records) {
  const std::size_t length = compression.record_length();
  std::copy_n(chunk.first_point.data(), length, records.data());
  for (std::size_t i = 1; i < returns.size(); ++i) {
    records[i * length + kNumbers] = static_cast<char>(returns[i].number | returns[i].count << 4);
    records[i * length + kFlags] = static_cast<char>(returns[i].channel << 4);
  }
  const std::vector<Turn> of_point = turns_of_point(returns), of_items = turns_of_items(returns, compression.version());
  std::string_view rest = chunk.others;
  std::size_t size_at = 8;  // behind those of the coordinates
  for (const Layer& layer : layers_of(compression)) {
    const std::size_t size = load_little<std::uint32_t>(chunk.sizes.data() + size_at);
    const std::string_view code = rest.substr(0, size);
    rest.remove_prefix(size);
    size_at += 4;
    if (!layer.bytes.meets(wanted)) continue;
    const Values values{records.data() + layer.bytes.begin, length};
    if (size == 0) {
      repeat_first(layer, returns, values);
      continue;
    }
    Decoder decoder(code);
    const bool sound = with_models(layer.part, [&]<class Models>() {
      return code_values<Models>(decoder, returns, layer.is_of_point() ? of_point : of_items, values);
    });
    if (!sound || decoder.overrun()) return false;
  }
  return true;
}

void encode_layered(const Compression& compression, std::span<const char> records, std::string& to) {
  const std::size_t length = compression.record_length();
  const std::vector<Returns> returns = returns_of(records, length);
  std::vector<Grid> grid(returns.size());
  for (std::size_t i = 0; i < grid.size(); ++i) grid[i] = get_grid(records.data() + i * length);
  const CoordinateCodes coordinates = encode_coordinates(grid, returns);
  std::vector<std::string> codes = {coordinates.returns_xy, coordinates.z};
  const std::vector<Turn> of_point = turns_of_point(returns), of_items = turns_of_items(returns, compression.version());
  for (const Layer& layer : layers_of(compression)) {
    char* const first = const_cast<char*>(records.data()) + layer.bytes.begin;  // which an encoder only reads
    codes.push_back(encode_values(layer, returns, layer.is_of_point() ? of_point : of_items, {first, length}));
  }
  to.append(records.data(), length);
  append_little<std::uint32_t>(to, static_cast<std::uint32_t>(returns.size()));
  for (const std::string& code : codes) append_little<std::uint32_t>(to, static_cast<std::uint32_t>(code.size()));
  for (const std::string& code : codes) to += code;
}

}  // namespace pointfair::io::las
