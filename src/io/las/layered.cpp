// SPDX-License-Identifier: Apache-2.0
#include "io/las/layered.hpp"

#include <algorithm>
#include <array>
#include <memory>
#include <type_traits>
#include <variant>
#include <vector>

#include "io/las/layer_models.hpp"

namespace pointfair::io::las {
namespace {

using namespace layer_models;

// Where the fields of item POINT14 are in a record.
constexpr std::size_t kIntensity = 12, kNumbers = 14, kFlags = 15, kClass = 16, kUser = 17, kAngle = 18, kSource = 20,
                      kTime = 22, kPointBytes = 30;

// What codes the values of a layer, as a type.
template <class... Models>
using OneOf = std::variant<std::type_identity<Models>...>;
using LayerModels = OneOf<Classifications, Flags, Intensities, ScanAngles, UserData, PointSources, Times, Colors,
                          NearInfrared, Waves, ExtraBytes>;

struct Layer {
  LayerModels models;
  ByteRange bytes;  // of the record

  bool is_of_point() const { return bytes.end <= kPointBytes; }
  template <class Models>
  bool has() const {
    return std::holds_alternative<std::type_identity<Models>>(models);
  }
};

template <class Models>
Layer layer_at(std::size_t begin) {
  return {std::type_identity<Models>(), {begin, begin + Models::kSize}};
}

// All behind those of the coordinates, in their order.
std::vector<Layer> layers_of(const Compression& compression) {
  std::vector<Layer> layers = {layer_at<Classifications>(kClass),
                               layer_at<Flags>(kFlags),
                               layer_at<Intensities>(kIntensity),
                               layer_at<ScanAngles>(kAngle),
                               layer_at<UserData>(kUser),
                               layer_at<PointSources>(kSource),
                               layer_at<Times>(kTime)};
  std::size_t at = 0;
  for (const Item& item : compression.items) {
    const bool has_near_infrared = item.type == Item::color_nir14;
    if (item.type == Item::color14 || has_near_infrared) layers.push_back(layer_at<Colors>(at));
    if (has_near_infrared) layers.push_back(layer_at<NearInfrared>(at + 6));
    if (item.type == Item::wave14) layers.push_back(layer_at<Waves>(at));
    for (std::size_t i = 0; item.type == Item::bytes14 && i < item.size; ++i)
      layers.push_back(layer_at<ExtraBytes>(at + i));
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

// Items other than the point's go in version 3 by what LASzip did before it was mended in version 4: they see the
// scanner channel only of a point where it changes, else 0, and a change does not change the last value.
std::vector<Turn> turns_of(std::span<const Returns> returns, bool is_mended) {
  std::vector<Turn> turns(returns.size());
  auto current = static_cast<std::uint8_t>(returns[0].channel);
  turns[0].models = current;
  std::array<bool, 4> seen{};
  seen[current] = true;
  for (std::size_t i = 1; i < returns.size(); ++i) {
    const bool is_seen = is_mended || returns[i].channel != returns[i - 1].channel;
    const auto channel = static_cast<std::uint8_t>(is_seen ? returns[i].channel : 0);
    turns[i] = {channel, is_mended || !seen[channel] ? channel : current, !seen[channel], current};
    seen[channel] = true;
    current = channel;
  }
  return turns;
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
    if (layer.has<Flags>()) *value = static_cast<char>((byte(*value) & 0xCF) | returns[i].channel << 4);
  }
}

bool changes(const Layer& layer, std::span<const Returns> returns, const Values& of) {
  if (layer.has<Times>()) return std::ranges::any_of(returns, [](Returns of_point) { return of_point.time_changed; });
  const std::size_t size = layer.bytes.end - layer.bytes.begin;
  const char *value = of.values, *const first = of.values;
  const bool is_colored = layer.has<Colors>() && !(std::equal(first, first + 4, first + 2));
  for (std::size_t i = 1; i < returns.size(); ++i) {
    value += of.length;
    const bool same =
        layer.has<Flags>() ? Flags::of(*value) == Flags::of(*first) : std::equal(first, first + size, value);
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
  std::visit([&]<class Models>(std::type_identity<Models>) { code_values<Models>(encoder, returns, turns, of); },
             layer.models);
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
  const std::vector<Turn> of_point = turns_of(returns, true), of_items = turns_of(returns, compression.version() != 3);
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
    const std::vector<Turn>& turns = layer.is_of_point() ? of_point : of_items;
    const bool sound = std::visit(
        [&]<class Models>(std::type_identity<Models>) { return code_values<Models>(decoder, returns, turns, values); },
        layer.models);
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
  const std::vector<Turn> of_point = turns_of(returns, true), of_items = turns_of(returns, compression.version() != 3);
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
