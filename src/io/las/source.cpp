// SPDX-License-Identifier: Apache-2.0
#include "io/las/source.hpp"

#include <algorithm>
#include <cmath>

#include "io/file_bytes.hpp"
#include "io/formats.hpp"
#include "io/las/coordinate_system.hpp"
#include "io/parallel.hpp"
#include "io/text.hpp"
#include "platform/path_text.hpp"

namespace pointfair::io {
namespace las {

namespace {

// What a header says of the whole file beside its coordinate system, where it says something. A new file of pointfair
// does not.
std::string set_in_header(std::string_view bytes) {
  constexpr unsigned kStandardTime = 1;
  const std::string_view system = get_text(bytes, place::system, 32);
  std::string set;
  const auto add = [&](bool is_set, const char* name) {
    set += is_set ? (set.empty() ? "" : ", ") + std::string(name) : "";
  };
  add(get<std::uint16_t>(bytes, place::source) != 0, "file source");
  add((get<std::uint16_t>(bytes, place::global_encoding) & kStandardTime) != 0, "type of GPS time");
  add(!system.empty() && system != kOwnSystem, "system");
  add(get<std::uint16_t>(bytes, place::day) != 0 || get<std::uint16_t>(bytes, place::year) != 0, "date");
  return set;
}

}  // namespace

LasSource::LasSource(FileBytes bytes, std::string name, Layout layout, std::unique_ptr<PointStore> store)
    : Source(std::move(bytes), std::move(name), layout.compression ? Format::laz : Format::las,
             layout.compression ? Encoding::binary_compressed : Encoding::binary),
      layout_(std::move(layout)),
      store_(std::move(store)),
      fields_(record_fields(layout_.header)) {}

void LasSource::positions(std::size_t block, std::span<Position> out) const {
  thread_local std::vector<Grid> grid;
  grid.resize(out.size());
  Decoded decoded;
  store_->grid(block, grid, decoded);
  for (std::size_t i = 0; i < out.size(); ++i)
    for (std::size_t axis = 0; axis < 3; ++axis) out[i][axis] = layout_.header.scaling.value(axis, grid[i][axis]);
}

void LasSource::extract_block(std::size_t index, std::size_t block, std::span<char> out) const {
  const Field& field = fields_[index];
  Decoded decoded;
  const std::string_view records = store_->records(block, field.bytes(), decoded);
  extract_field(field, records.data(), layout_.header.record_length, block_size(block), out.data());
}

std::vector<Content> LasSource::contents() const {
  // Those of LASzip, COPC and extra bytes say how the points are stored.
  const auto is_of_points = [](const Record& record) {
    return record.user == "laszip encoded" || record.user == "copc" || record.is("LASF_Spec", 4);
  };
  const auto is_system = [](const Record& record) { return record.user == "LASF_Projection"; };
  const auto& records = layout_.header.records;
  std::vector<Content> result;
  if (std::ranges::any_of(records, is_system))
    result.push_back({ContentKind::coordinate_system, "the coordinate system"});
  const auto others = static_cast<std::uint64_t>(std::ranges::count_if(
      records, [&](const Record& record) { return !is_system(record) && !is_of_points(record); }));
  if (others > 0) result.push_back({ContentKind::records, counted(others, "further record") + " of the LAS file"});
  if (!companions().empty()) result.push_back({ContentKind::records, "the waveforms in the file beside it"});
  if (const std::string set = set_in_header(bytes()); !set.empty())
    result.push_back({ContentKind::records, "what the header of the LAS file says: " + set});
  return result;
}

std::vector<std::string> LasSource::losses(Encoding) const {
  std::vector<std::string> result;
  if (layout_.is_copc())
    result.push_back("the COPC index of the input no longer fits points that moved, so the output is plain LAZ or LAS");
  if (const std::filesystem::path index = companion_of(*this, ".lax"); !index.empty())
    result.push_back(platform::text_of(index) +
                     " does not fit points that moved, so it was not copied; lasindex makes a new one");
  return result;
}

FileInfo LasSource::info() const {
  const Header& header = layout_.header;
  const CoordinateSystem system = coordinate_system(header);
  FileInfo result;
  result.metres_per_unit = system.metres_per_unit;
  result.metres_per_height = system.metres_per_height;
  result.is_geographic = system.is_geographic;
  result.has_old_classes = header.point_format < 6;
  result.step = *std::ranges::max_element(header.scaling.scale);
  result.rows = {{"version", "LAS 1." + std::to_string(header.minor) + (header.compressed ? ", compressed" : "")},
                 {"point_format", std::to_string(header.point_format)},
                 {"coordinate_system", system.name},
                 {"scale", listed_numbers(header.scaling.scale, 15)},
                 {"offset", listed_numbers(header.scaling.offset, 15)},
                 {"software", std::string(get_text(bytes(), place::software, 32))},
                 {"system", std::string(get_text(bytes(), place::system, 32))}};
  result.is_octree = layout_.is_copc();
  if (result.is_octree) result.rows.front().value += ", COPC";
  return result;
}

// Waveforms: a bit of the header says that they are in a file of their own.
std::vector<std::string> LasSource::companions() const {
  constexpr unsigned kExternalWaveforms = 4;
  const bool external = (get<std::uint16_t>(bytes(), place::global_encoding) & kExternalWaveforms) != 0;
  return external ? std::vector<std::string>{".wdp"} : std::vector<std::string>{};
}

namespace {

// The last 8 bytes of a file that could not be written backwards say where the table is; they are no part of the tail.
std::size_t tail_begin(std::string_view bytes, const Header& header, const ChunkTable& table, const std::string& name) {
  if (header.extended_begin != 0 && header.extended_begin <= table.begin)
    fail(name, "its header places records among the points; repair the header");
  if (header.extended_begin != 0) return std::min(table.end, header.extended_begin);
  const bool streamed = get<std::uint64_t>(bytes, header.points_begin) == ~std::uint64_t{0};
  return streamed ? std::min(bytes.size(), table.end + 8) : table.end;
}

}  // namespace
}  // namespace las

std::shared_ptr<Source> read_las(FileBytes bytes, const std::string& name, const Reading& reading) {
  using namespace las;
  const std::string_view view = bytes.view();
  if (!view.starts_with("LASF")) fail(name, "is no LAS file: it does not begin with LASF; choose another file");
  Layout layout;
  layout.header = parse_header(view, name);
  if (!layout.header.compressed) {
    auto store = open_records(view, layout.header, name);
    layout.points_end = layout.chunks_end = layout.table_begin =
        layout.header.points_begin + static_cast<std::size_t>(layout.header.count) * layout.header.record_length;
    return std::make_shared<LasSource>(std::move(bytes), name, std::move(layout), std::move(store));
  }
  layout.compression = read_compression(layout.header, name);
  if (layout.compression->pointwise) {
    std::size_t end = view.size();  // nothing says where the points end
    for (const std::size_t begin : {layout.header.extended_begin, layout.header.waveform_begin})
      if (begin > layout.header.points_begin) end = std::min(end, begin);
    layout.points_end = layout.chunks_end = layout.table_begin = end;
    const std::size_t begin = layout.header.points_begin;
    auto store =
        decode_pointwise(view.substr(begin, end - begin), layout.header, *layout.compression, view.size(), name);
    return std::make_shared<LasSource>(std::move(bytes), name, std::move(layout), std::move(store));
  }
  ChunkTable table = read_chunk_table(view, layout.header, *layout.compression, name);
  const std::string_view last = table.chunks.back().bytes;
  layout.chunks_end = static_cast<std::size_t>(last.data() + last.size() - view.data());
  layout.table_begin = table.begin;
  layout.points_end = tail_begin(view, layout.header, table, name);
  auto store =
      decode_chunks(std::move(table.chunks), layout.header, *layout.compression, view.size(), name, reading.residence);
  return std::make_shared<LasSource>(std::move(bytes), name, std::move(layout), std::move(store));
}

}  // namespace pointfair::io
