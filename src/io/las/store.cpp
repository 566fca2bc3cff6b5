// SPDX-License-Identifier: Apache-2.0
#include "io/las/store.hpp"

#include <algorithm>
#include <atomic>
#include <cstring>

#include "io/file_bytes.hpp"
#include "io/las/codec.hpp"
#include "io/las/fields.hpp"
#include "io/las/layers.hpp"
#include "io/parallel.hpp"

namespace pointfair::io::las {
namespace {

void read_grid(const char* record, std::size_t record_length, std::span<Grid> out) {
  for (Grid& grid : out) {
    for (std::size_t axis = 0; axis < 3; ++axis) grid[axis] = load<std::int32_t>(record + 4 * axis, kSwap);
    record += record_length;
  }
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
  void grid(std::size_t block, std::span<Grid> out) const override {
    std::string unused;
    read_grid(records(block, 0, unused).data(), record_length_, out);
  }
  std::string_view records(std::size_t block, std::uint32_t, std::string&) const override {
    return points_.substr(static_cast<std::size_t>(block_begin(block)) * record_length_,
                          block_size(block) * record_length_);
  }

 private:
  std::string_view points_;
  std::size_t record_length_;
  std::uint64_t count_;
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
  bool decode(std::size_t block, std::uint32_t layers, std::span<char> records) const {
    return decode_chunk(compression_, chunk(block), static_cast<std::uint32_t>(block_size(block)), layers, records);
  }
  const Compression& compression() const { return compression_; }
  std::size_t record_length() const { return record_length_; }

 private:
  std::vector<Chunk> chunks_;
  Compression compression_;
  std::size_t record_length_;
  std::string name_;
};

class DecodedRecords : public Chunks {
 public:
  DecodedRecords(std::vector<Chunk> chunks, const Compression& compression, std::size_t record_length,
                 std::size_t file_size, const std::string& name)
      : Chunks(std::move(chunks), compression, record_length, name) {
    check_plausible(block_begin(block_count()), 0, record_length, file_size, name);
    const std::uint64_t size = block_begin(block_count()) * record_length;
    records_ = std::make_unique_for_overwrite<char[]>(static_cast<std::size_t>(size));
    for_each_block(block_count(), [&](std::size_t block) {
      require(decode(block, kAllLayers, {records_.get() + begin(block), block_size(block) * record_length}), block);
    });
  }

  void grid(std::size_t block, std::span<Grid> out) const override {
    read_grid(records_.get() + begin(block), record_length(), out);
  }
  std::string_view records(std::size_t block, std::uint32_t, std::string&) const override {
    return {records_.get() + begin(block), block_size(block) * record_length()};
  }

 private:
  std::size_t begin(std::size_t block) const { return static_cast<std::size_t>(block_begin(block)) * record_length(); }

  std::unique_ptr<char[]> records_;
};

// Decoded again each time they are asked for.
class KeptRecords : public Chunks {
 public:
  using Chunks::Chunks;

  void grid(std::size_t block, std::span<Grid> out) const override {
    std::string buffer;
    read_grid(records(block, kAllLayers, buffer).data(), record_length(), out);
  }
  std::string_view records(std::size_t block, std::uint32_t, std::string& buffer) const override {
    buffer.resize(block_size(block) * record_length());
    require(decode(block, kAllLayers, buffer), block);
    return buffer;
  }
};

class LayeredChunks : public Chunks {
 public:
  using Chunks::Chunks;

  void grid(std::size_t block, std::span<Grid> out) const override {
    std::copy_n(coordinates(block).grid.begin(), out.size(), out.begin());
  }

  std::string_view records(std::size_t block, std::uint32_t layers, std::string& buffer) const override {
    buffer.assign(block_size(block) * record_length(), '\0');
    if (layers == 0) {
      fill_returns(coordinates(block).returns, buffer);
    } else {
      require(decode(block, layers, buffer), block);
    }
    return buffer;
  }

  bool append_moved_chunk(std::size_t block, std::span<const Grid> now, std::string& to) const override {
    encode_layers(*split(block), now, coordinates(block).returns, to);
    return true;
  }

 protected:
  struct Coordinates {
    std::span<const Grid> grid;
    std::span<const Returns> returns;
  };
  virtual Coordinates coordinates(std::size_t block) const = 0;

  void decode_coordinates(std::size_t block, std::span<Grid> grid, std::span<Returns> returns) const {
    const auto layers = split(block);
    require(layers && decode_layers(*layers, grid, returns), block);
  }

 private:
  std::optional<LayeredChunk> split(std::size_t block) const {
    return split_layers(chunk(block), record_length(), compression().layers(),
                        static_cast<std::uint32_t>(block_size(block)));
  }

  void fill_returns(std::span<const Returns> returns, std::string& records) const {
    const Returns* from = returns.data();
    for (char* to = records.data(); to != records.data() + records.size(); to += record_length(), ++from) {
      to[14] = static_cast<char>(from->number | from->count << 4);
      to[15] = static_cast<char>(from->channel << 4);
    }
  }
};

class DecodedLayers : public LayeredChunks {
 public:
  DecodedLayers(std::vector<Chunk> chunks, const Compression& compression, std::size_t record_length,
                std::size_t file_size, const std::string& name)
      : LayeredChunks(std::move(chunks), compression, record_length, name) {
    const std::uint64_t count = block_begin(block_count());
    check_plausible(count, 0, sizeof(Grid) + sizeof(Returns), file_size, name);
    grid_ = std::make_unique_for_overwrite<Grid[]>(static_cast<std::size_t>(count));
    returns_ = std::make_unique_for_overwrite<Returns[]>(static_cast<std::size_t>(count));
    for_each_block(block_count(), [&](std::size_t block) {
      decode_coordinates(block, {grid_.get() + block_begin(block), block_size(block)},
                         {returns_.get() + block_begin(block), block_size(block)});
    });
  }

 protected:
  Coordinates coordinates(std::size_t block) const override {
    return {{grid_.get() + block_begin(block), block_size(block)},
            {returns_.get() + block_begin(block), block_size(block)}};
  }

 private:
  std::unique_ptr<Grid[]> grid_;
  std::unique_ptr<Returns[]> returns_;
};

// Decoded again each time they are asked for, but for the thread's last block.
class KeptLayers : public LayeredChunks {
 public:
  using LayeredChunks::LayeredChunks;

 protected:
  Coordinates coordinates(std::size_t block) const override {
    struct Last {
      std::uint64_t store = 0;
      std::size_t block = 0;
      std::vector<Grid> grid;
      std::vector<Returns> returns;
    };
    thread_local Last last;
    if (last.store != number_ || last.block != block) {
      last.store = 0;
      last.grid.resize(block_size(block));
      last.returns.resize(block_size(block));
      decode_coordinates(block, last.grid, last.returns);
      last.store = number_;
      last.block = block;
    }
    return {last.grid, last.returns};
  }

 private:
  static std::uint64_t next_number() {
    static std::atomic<std::uint64_t> last{0};
    return ++last;
  }
  const std::uint64_t number_ = next_number();  // an address would serve a later store, too
};

}  // namespace

std::unique_ptr<PointStore> open_records(std::string_view bytes, const Header& header, const std::string& name) {
  const std::string_view rest = bytes.substr(header.points_begin);
  const std::uint64_t room = rest.size() / header.record_length;
  if (header.count > room) {
    fail(name, "header promises " + std::to_string(header.count) + " points, file ends after " + std::to_string(room) +
                   "; copy the file again or correct the header");
  }
  const auto size = static_cast<std::size_t>(header.count) * header.record_length;
  return std::make_unique<FileRecords>(rest.substr(0, size), header.record_length, header.count);
}

std::unique_ptr<PointStore> decode_chunks(std::vector<Chunk> chunks, const Header& header,
                                          const Compression& compression, std::size_t file_size,
                                          const std::string& name, Residence residence) {
  if (residence == Residence::file) {
    if (compression.layered())
      return std::make_unique<KeptLayers>(std::move(chunks), compression, header.record_length, name);
    return std::make_unique<KeptRecords>(std::move(chunks), compression, header.record_length, name);
  }
  if (!compression.layered()) {
    return std::make_unique<DecodedRecords>(std::move(chunks), compression, header.record_length, file_size, name);
  }
  return std::make_unique<DecodedLayers>(std::move(chunks), compression, header.record_length, file_size, name);
}

}  // namespace pointfair::io::las
