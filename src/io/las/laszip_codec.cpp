// SPDX-License-Identifier: Apache-2.0
// The only file that sees LASzip. Its reader and writer of points are given one chunk as if it were a whole file.
#include "io/las/laszip_codec.hpp"

#include <cstdio>
#include <cstring>
#include <lasreadpoint.hpp>
#include <laswritepoint.hpp>
#include <laszip.hpp>

#include "io/las/arithmetic.hpp"
#include "io/las/fields.hpp"
#include "io/las/layers.hpp"

namespace pointfair::io::las {
namespace {

// LASzip's streams have big-endian calls, too, which a machine that is little endian never uses.
static_assert(std::endian::native == std::endian::little);

class ChunkReader : public ByteStreamIn {
 public:
  explicit ChunkReader(std::string_view bytes) : bytes_(bytes) {}

  U32 getByte() override {
    if (at_ == bytes_.size()) throw EOF;  // as LASzip's own streams do
    return static_cast<unsigned char>(bytes_[at_++]);
  }
  void getBytes(U8* to, const I64 count) override {
    if (count < 0 || static_cast<std::uint64_t>(count) > bytes_.size() - at_) throw EOF;
    if (count != 0) std::memcpy(to, bytes_.data() + at_, static_cast<std::size_t>(count));
    at_ += static_cast<std::size_t>(count);
  }
  void get16bitsLE(U8* to) override { getBytes(to, 2); }
  void get32bitsLE(U8* to) override { getBytes(to, 4); }
  void get64bitsLE(U8* to) override { getBytes(to, 8); }
  void get16bitsBE(U8*) override { throw EOF; }
  void get32bitsBE(U8*) override { throw EOF; }
  void get64bitsBE(U8*) override { throw EOF; }
  BOOL isSeekable() const override { return FALSE; }
  I64 tell() const override { return static_cast<I64>(at_); }
  BOOL seek(const I64) override { return FALSE; }
  BOOL seekEnd(const I64) override { return FALSE; }
  BOOL skipBytes(const U32 count) override {
    if (count > bytes_.size() - at_) throw EOF;
    at_ += count;
    return TRUE;
  }

 private:
  std::string_view bytes_;
  std::size_t at_ = 0;
};

class ChunkWriter : public ByteStreamOut {
 public:
  explicit ChunkWriter(std::string& to) : to_(to), begin_(to.size()) {}

  BOOL putByte(U8 byte) override {
    to_ += static_cast<char>(byte);
    return TRUE;
  }
  BOOL putBytes(const U8* bytes, U32 count) override {
    to_.append(reinterpret_cast<const char*>(bytes), count);
    return TRUE;
  }
  BOOL put16bitsLE(const U8* bytes) override { return putBytes(bytes, 2); }
  BOOL put32bitsLE(const U8* bytes) override { return putBytes(bytes, 4); }
  BOOL put64bitsLE(const U8* bytes) override { return putBytes(bytes, 8); }
  BOOL put16bitsBE(const U8*) override { return FALSE; }
  BOOL put32bitsBE(const U8*) override { return FALSE; }
  BOOL put64bitsBE(const U8*) override { return FALSE; }
  BOOL isSeekable() const override { return FALSE; }
  I64 tell() const override { return static_cast<I64>(to_.size() - begin_); }
  BOOL seek(const I64) override { return FALSE; }
  BOOL seekEnd() override { return FALSE; }

 private:
  std::string& to_;
  std::size_t begin_;
};

// What LASzip takes for a description of the file. Points of formats 0 to 5 are described as compressed in one piece,
// so that nothing but the chunk is read or written.
class Description {
 public:
  Description(const Compression& compression, std::uint32_t points) {
    laszip_.num_items = static_cast<unsigned short>(compression.items.size());
    laszip_.items = new LASitem[compression.items.size()];  // freed by its destructor
    for (std::size_t i = 0; i < compression.items.size(); ++i) {
      const Item& item = compression.items[i];
      laszip_.items[i] = {static_cast<LASitem::Type>(item.type), item.size, item.version};
    }
    laszip_.compressor = compression.layered() ? LASZIP_COMPRESSOR_LAYERED_CHUNKED : LASZIP_COMPRESSOR_POINTWISE;
    laszip_.coder = LASZIP_CODER_ARITHMETIC;
    laszip_.chunk_size = points;
  }

  template <class ReaderOrWriter>
  void set_up(ReaderOrWriter& codec) const {
    if (!codec.setup(laszip_.num_items, laszip_.items, &laszip_)) throw std::bad_alloc();
  }

 private:
  LASzip laszip_;
};

// LASzip holds the first 30 bytes of a point of format 6 to 10 in a form of its own, with copies of some fields as
// formats 0 to 5 have them. The numbers are places in it.
class WidePoint {
 public:
  U8* data() { return reinterpret_cast<U8*>(bytes_); }

  void pack(char* record) const {
    std::memcpy(record, bytes_, 14);
    record[14] = bytes_[24];
    const auto directions = static_cast<unsigned char>(bytes_[14]), flags = static_cast<unsigned char>(bytes_[22]);
    record[15] = static_cast<char>((flags >> 4) | (flags >> 2 & 3) << 4 | (directions & 0xC0));
    record[16] = bytes_[23];
    record[17] = bytes_[17];
    std::memcpy(record + 18, bytes_ + 20, 2);
    std::memcpy(record + 20, bytes_ + 18, 2);
    std::memcpy(record + 22, bytes_ + 32, 8);
  }

  void unpack(const char* record) {
    std::memcpy(bytes_, record, 14);
    const auto flags = static_cast<unsigned char>(record[15]), classification = static_cast<unsigned char>(record[16]);
    bytes_[14] = static_cast<char>(flags & 0xC0);
    bytes_[15] = static_cast<char>((flags & 7) << 5 | (classification < 32 ? classification : 0));
    bytes_[17] = record[17];
    std::memcpy(bytes_ + 18, record + 20, 2);
    std::memcpy(bytes_ + 20, record + 18, 2);
    bytes_[22] = static_cast<char>(1 | (flags >> 4 & 3) << 2 | (flags & 15) << 4);  // 1: a point of this form
    bytes_[23] = record[16];
    bytes_[24] = record[14];
    std::memcpy(bytes_ + 32, record + 22, 8);
  }

 private:
  alignas(8) char bytes_[128] = {};
};

// Where LASzip finds the items of a point: in the record itself, but for the first of a layered one.
class ItemPointers {
 public:
  explicit ItemPointers(const Compression& compression) : layered_(compression.layered()) {
    std::size_t offset = 0;
    for (const Item& item : compression.items) {
      offsets_.push_back(offset);
      offset += item.size;
    }
    record_length_ = offset;
    pointers_.resize(offsets_.size());
  }

  std::size_t record_length() const { return record_length_; }
  U8** at(char* record, WidePoint& wide) {
    for (std::size_t i = 0; i < offsets_.size(); ++i) pointers_[i] = reinterpret_cast<U8*>(record + offsets_[i]);
    if (layered_) pointers_[0] = wide.data();
    return pointers_.data();
  }

 private:
  bool layered_;
  std::size_t record_length_;
  std::vector<std::size_t> offsets_;
  std::vector<U8*> pointers_;
};

}  // namespace

bool has_laszip() { return true; }

bool laszip_decode(const Compression& compression, std::string_view chunk, std::uint32_t points, std::uint32_t layers,
                   std::span<char> records) {
  ItemPointers items(compression);
  // Before a layered chunk LASzip reads where the table of chunks is; 0 makes it do without.
  std::string whole;
  if (compression.layered()) {
    if (!split_layers(chunk, items.record_length(), compression.layers(), points)) return false;
    whole.assign(8, '\0').append(chunk);
    chunk = whole;
  } else if (chunk.size() < items.record_length() || is_impossible_code(chunk.substr(items.record_length()))) {
    return false;
  }
  ChunkReader stream(chunk);
  const Description description(compression, points);
  LASreadPoint reader(layers);
  description.set_up(reader);
  if (!reader.init(&stream)) return false;
  WidePoint wide;
  for (char* record = records.data(); record != records.data() + records.size(); record += items.record_length()) {
    if (!reader.read(items.at(record, wide))) return false;
    if (compression.layered()) wide.pack(record);
  }
  return true;
}

void laszip_encode(const Compression& compression, std::span<const char> records, std::string& to) {
  ItemPointers items(compression);
  const std::size_t begin = to.size();
  ChunkWriter stream(to);
  const Description description(compression, static_cast<std::uint32_t>(records.size() / items.record_length()));
  LASwritePoint writer;
  description.set_up(writer);
  writer.init(&stream);
  WidePoint wide;
  for (const char* record = records.data(); record != records.data() + records.size();
       record += items.record_length()) {
    if (compression.layered()) wide.unpack(record);
    writer.write(items.at(const_cast<char*>(record), wide));  // which LASzip does not change
  }
  writer.done();
  if (!compression.layered()) return;
  // Before the chunk stands -1, behind it the table and, as the last 8 bytes, where that begins.
  const auto table = get<std::uint64_t>(to, to.size() - 8);
  to.resize(begin + static_cast<std::size_t>(table));
  to.erase(begin, 8);
}

}  // namespace pointfair::io::las
