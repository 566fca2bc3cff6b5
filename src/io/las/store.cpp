// SPDX-License-Identifier: Apache-2.0
#include "io/las/store.hpp"

#include <algorithm>
#include <cstring>
#include <limits>

#include "io/file_bytes.hpp"
#include "io/las/interleaved.hpp"
#include "io/las/layered.hpp"
#include "io/parallel.hpp"
#include "platform/large_pages.hpp"

namespace pointfair::io::las {
namespace {

void read_grid(const char* record, std::size_t record_length, std::span<Grid> out) {
  for (Grid& grid : out) {
    grid = get_grid(record);
    record += record_length;
  }
}

// Not initialized.
template <class T>
std::unique_ptr<T[]> make_large(std::uint64_t count) {
  auto made = std::make_unique_for_overwrite<T[]>(static_cast<std::size_t>(count));
  platform::prefer_large_pages(made.get(), static_cast<std::size_t>(count) * sizeof(T));
  return made;
}

class FileRecords : public PointStore {
 public:
  FileRecords(std::string_view points, std::size_t record_length, std::uint64_t count)
      : points_(points), record_length_(record_length), count_(count) {}

  std::size_t block_count() const override {
    return static_cast<std::size_t>((count_ + kUsualChunk - 1) / kUsualChunk);
  }
  std::uint64_t block_begin(std::size_t block) const override {
    return std::min<std::uint64_t>(std::uint64_t{block} * kUsualChunk, count_);
  }
  void grid(std::size_t block, std::span<Grid> out, Decoded& unused) const override {
    read_grid(records(block, {}, unused).data(), record_length_, out);
  }
  std::string_view records(std::size_t block, ByteRange, Decoded&) const override {
    return points_.substr(static_cast<std::size_t>(block_begin(block)) * record_length_,
                          block_size(block) * record_length_);
  }

 private:
  std::string_view points_;
  std::size_t record_length_;
  std::uint64_t count_;
};

// As if they were those of an uncompressed file.
class PointwiseRecords final : public FileRecords {
 public:
  PointwiseRecords(std::unique_ptr<char[]> records, std::size_t record_length, std::uint64_t count)
      : FileRecords({records.get(), static_cast<std::size_t>(count) * record_length}, record_length, count),
        records_(std::move(records)) {}

 private:
  std::unique_ptr<char[]> records_;
};

class Chunks : public PointStore {
 public:
  Chunks(std::vector<Chunk> chunks, Compression compression, std::size_t record_length, std::string name)
      : chunks_(std::move(chunks)),
        compression_(std::move(compression)),
        record_length_(record_length),
        name_(std::move(name)) {}

  std::size_t block_count() const override { return chunks_.size(); }
  std::uint64_t block_begin(std::size_t block) const override {
    if (block < chunks_.size()) return chunks_[block].first_point;
    return chunks_.back().first_point + chunks_.back().points;
  }
  std::string_view chunk(std::size_t block) const override { return chunks_[block].bytes; }

 protected:
  void require(bool decoded, std::size_t block) const {
    if (!decoded) fail(name_, "chunk " + std::to_string(block) + " of its points is damaged; copy the file again");
  }
  const Compression& compression() const { return compression_; }
  std::size_t record_length() const { return record_length_; }

 private:
  std::vector<Chunk> chunks_;
  Compression compression_;
  std::size_t record_length_;
  std::string name_;
};

// Points whose chunks hold whole records, all of which may be held.
class DecodedRecords : public Chunks {
 public:
  DecodedRecords(std::vector<Chunk> chunks, const Compression& compression, std::size_t record_length,
                 const std::string& name, bool holds)
      : Chunks(std::move(chunks), compression, record_length, name) {
    if (!holds) return;
    records_ = make_large<char>(block_begin(block_count()) * record_length);
    // Two chunks a thread at once where that leaves none idle.
    const std::size_t at_once = block_count() >= 4 * concurrency() ? 2 : 1;
    for_each_block((block_count() + at_once - 1) / at_once, [&](std::size_t group) {
      const std::size_t first = group * at_once, last = std::min(first + at_once, block_count());
      if (last - first == 2 && decode_two_interleaved(compression, coded(first), coded(first + 1))) return;
      for (std::size_t block = first; block < last; ++block) decode_into(block, coded(block).records);
    });
  }

  void grid(std::size_t block, std::span<Grid> out, Decoded& decoded) const override {
    read_grid(records(block, {}, decoded).data(), record_length(), out);
  }
  std::string_view records(std::size_t block, ByteRange, Decoded& decoded) const override {
    const std::size_t size = block_size(block) * record_length();
    if (records_) return {records_.get() + begin(block), size};
    if (decoded.block != block) {
      decoded.block.reset();
      decoded.records.resize(size);
      decode_into(block, decoded.records);
      decoded.block = block;
    }
    return decoded.records;
  }

 private:
  std::size_t begin(std::size_t block) const { return static_cast<std::size_t>(block_begin(block)) * record_length(); }
  CodedChunk coded(std::size_t block) const {
    return {chunk(block), {records_.get() + begin(block), block_size(block) * record_length()}};
  }
  void decode_into(std::size_t block, std::span<char> records) const {
    require(decode_interleaved(compression(), {chunk(block), records}), block);
  }

  std::unique_ptr<char[]> records_;
};

// Points in layers. All that may be held is their coordinates and what else coding them again needs.
class DecodedLayers : public Chunks {
  static constexpr std::size_t kGridBytes = 12;  // of the coordinates, with which a record begins

 public:
  DecodedLayers(std::vector<Chunk> chunks, const Compression& compression, std::size_t record_length,
                const std::string& name, bool holds)
      : Chunks(std::move(chunks), compression, record_length, name) {
    if (!holds) return;
    const std::uint64_t count = block_begin(block_count());
    grid_ = make_large<Grid>(count);
    returns_ = make_large<Returns>(count);
    for_each_block(block_count(), [&](std::size_t block) {
      decode_into(block, {grid_.get() + block_begin(block), block_size(block)},
                  {returns_.get() + block_begin(block), block_size(block)});
    });
  }

  void grid(std::size_t block, std::span<Grid> out, Decoded& decoded) const override {
    if (grid_) {
      std::copy_n(grid_.get() + block_begin(block), out.size(), out.begin());
    } else {
      decode_into(block, out, decoded);
    }
  }

  std::string_view records(std::size_t block, ByteRange wanted, Decoded& decoded) const override {
    decoded.records.assign(block_size(block) * record_length(), '\0');
    if (wanted.meets({0, kGridBytes})) {
      std::vector<Grid> own(block_size(block));
      grid(block, own, decoded);
      for (std::size_t i = 0; i < own.size(); ++i) put_grid(own[i], decoded.records.data() + i * record_length());
    }
    const auto layers = split(block);
    require(layers && decode_layered(compression(), *layers, returns(block, decoded), wanted, decoded.records), block);
    return decoded.records;
  }

  bool append_moved_chunk(std::size_t block, std::span<const Grid> now, Decoded& decoded,
                          std::string& to) const override {
    encode_layers(*split(block), now, returns(block, decoded), to);
    return true;
  }

 private:
  std::optional<LayeredChunk> split(std::size_t block) const {
    return split_layers(chunk(block), record_length(), compression().layers(),
                        static_cast<std::uint32_t>(block_size(block)));
  }

  void decode_into(std::size_t block, std::span<Grid> grid, std::span<Returns> returns) const {
    const auto layers = split(block);
    require(layers && decode_layers(*layers, grid, returns), block);
  }
  void decode_into(std::size_t block, std::span<Grid> grid, Decoded& decoded) const {
    decoded.block.reset();
    decoded.returns.resize(grid.size());
    decode_into(block, grid, decoded.returns);
    decoded.block = block;
  }

  std::span<const Returns> returns(std::size_t block, Decoded& decoded) const {
    if (returns_) return {returns_.get() + block_begin(block), block_size(block)};
    if (decoded.block != block) {
      std::vector<Grid> unused(block_size(block));
      decode_into(block, unused, decoded);
    }
    return decoded.returns;
  }

  std::unique_ptr<Grid[]> grid_;
  std::unique_ptr<Returns[]> returns_;
};

}  // namespace

std::unique_ptr<PointStore> open_records(std::string_view bytes, const Header& header, const std::string& name) {
  const std::string_view rest = bytes.substr(header.points_begin);
  const std::uint64_t room = rest.size() / header.record_length;
  if (header.count > room)
    fail(name, "header promises " + std::to_string(header.count) + " points, file ends after " + std::to_string(room) +
                   "; copy the file again or correct the header");
  const auto size = static_cast<std::size_t>(header.count) * header.record_length;
  return std::make_unique<FileRecords>(rest.substr(0, size), header.record_length, header.count);
}

std::unique_ptr<PointStore> decode_pointwise(std::string_view chunk, const Header& header,
                                             const Compression& compression, std::size_t file_size,
                                             const std::string& name) {
  if (chunk.size() < header.record_length) fail(name, "the file ends before its points; copy it again");
  if (header.count > std::numeric_limits<std::uint32_t>::max())
    fail(name, "has more than 4294967295 points in one piece; write it again with a current LASzip");
  check_plausible(header.count, 0, header.record_length, file_size, name);
  const std::size_t size = static_cast<std::size_t>(header.count) * header.record_length;
  auto records = make_large<char>(size);
  if (!decode_interleaved(compression, {chunk, {records.get(), size}}))
    fail(name, "its points are damaged, or the file ends before the last; copy it again");
  return std::make_unique<PointwiseRecords>(std::move(records), header.record_length, header.count);
}

std::unique_ptr<PointStore> decode_chunks(std::vector<Chunk> chunks, const Header& header,
                                          const Compression& compression, std::size_t file_size,
                                          const std::string& name, Residence residence, std::uint64_t most_kept) {
  const bool layered = compression.layered();
  const std::size_t point_bytes = layered ? sizeof(Grid) + sizeof(Returns) : header.record_length;
  const bool in_memory = residence == Residence::memory;
  if (in_memory) check_plausible(header.count, 0, point_bytes, file_size, name);
  const bool holds = in_memory && header.count <= most_kept / point_bytes;
  if (layered)
    return std::make_unique<DecodedLayers>(std::move(chunks), compression, header.record_length, name, holds);
  return std::make_unique<DecodedRecords>(std::move(chunks), compression, header.record_length, name, holds);
}

}  // namespace pointfair::io::las
