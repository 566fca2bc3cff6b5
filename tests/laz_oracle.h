// SPDX-License-Identifier: Apache-2.0
// LAZ files made and read by LASzip alone, from end to end: its own chunks and tables. What pointfair makes of such
// files is compared with it.
#pragma once

#include <cstdio>
#include <lasreadpoint.hpp>
#include <laswritepoint.hpp>
#include <laszip.hpp>
#include <stdexcept>

#include "las_files.h"

namespace pointfair::test {

class LazBytesIn : public ByteStreamIn {
 public:
  explicit LazBytesIn(const std::string& bytes) : bytes_(bytes) {}
  U32 getByte() override {
    if (at_ >= bytes_.size()) throw EOF;
    return static_cast<unsigned char>(bytes_[at_++]);
  }
  void getBytes(U8* to, const I64 count) override {
    for (I64 i = 0; i < count; ++i) to[i] = static_cast<U8>(getByte());
  }
  void get16bitsLE(U8* to) override { getBytes(to, 2); }
  void get32bitsLE(U8* to) override { getBytes(to, 4); }
  void get64bitsLE(U8* to) override { getBytes(to, 8); }
  void get16bitsBE(U8*) override { throw EOF; }
  void get32bitsBE(U8*) override { throw EOF; }
  void get64bitsBE(U8*) override { throw EOF; }
  BOOL isSeekable() const override { return TRUE; }
  I64 tell() const override { return static_cast<I64>(at_); }
  BOOL seek(const I64 at) override {
    at_ = static_cast<std::size_t>(at);
    return TRUE;
  }
  BOOL seekEnd(const I64 distance) override { return seek(static_cast<I64>(bytes_.size()) - distance); }

 private:
  const std::string& bytes_;
  std::size_t at_ = 0;
};

class LazBytesOut : public ByteStreamOut {
 public:
  LazBytesOut(std::string& bytes, bool seekable) : bytes_(bytes), at_(bytes.size()), seekable_(seekable) {}
  BOOL putByte(U8 byte) override {
    if (at_ == bytes_.size()) bytes_ += '\0';
    bytes_[at_++] = static_cast<char>(byte);
    return TRUE;
  }
  BOOL putBytes(const U8* from, U32 count) override {
    for (U32 i = 0; i < count; ++i) putByte(from[i]);
    return TRUE;
  }
  BOOL put16bitsLE(const U8* from) override { return putBytes(from, 2); }
  BOOL put32bitsLE(const U8* from) override { return putBytes(from, 4); }
  BOOL put64bitsLE(const U8* from) override { return putBytes(from, 8); }
  BOOL put16bitsBE(const U8*) override { return FALSE; }
  BOOL put32bitsBE(const U8*) override { return FALSE; }
  BOOL put64bitsBE(const U8*) override { return FALSE; }
  BOOL isSeekable() const override { return seekable_; }
  I64 tell() const override { return static_cast<I64>(at_); }
  BOOL seek(const I64 at) override {
    at_ = static_cast<std::size_t>(at);
    return TRUE;
  }
  BOOL seekEnd() override { return seek(static_cast<I64>(bytes_.size())); }

 private:
  std::string& bytes_;
  std::size_t at_;
  bool seekable_;
};

/// A point as LASzip's interface has it (laszip_point in laszip_api.h), with the items of a record behind it.
class LazPoint {
 public:
  explicit LazPoint(const LASzip& laszip) : laszip_(laszip), wide_(laszip.items[0].type == LASitem::POINT14) {}

  U8** items(std::string& record) {
    std::size_t offset = 0;
    for (unsigned i = 0; i < laszip_.num_items; ++i) {
      items_[i] = reinterpret_cast<U8*>(record.data()) + offset;
      offset += laszip_.items[i].size;
    }
    if (wide_) items_[0] = point_;
    return items_;
  }
  void take(const std::string& record) {
    if (!wide_) return;
    const auto* r = reinterpret_cast<const U8*>(record.data());
    std::memcpy(point_, r, 14);
    point_[14] = static_cast<U8>(r[15] & 0xC0);
    point_[15] = static_cast<U8>((r[16] < 32 ? r[16] : 0) | (r[15] & 7) << 5);
    point_[17] = r[17];
    std::memcpy(point_ + 18, r + 20, 2);
    std::memcpy(point_ + 20, r + 18, 2);
    point_[22] = static_cast<U8>(1 | (r[15] >> 4 & 3) << 2 | (r[15] & 15) << 4);
    point_[23] = r[16];
    point_[24] = r[14];
    std::memcpy(point_ + 32, r + 22, 8);
  }
  void give(std::string& record) const {
    if (!wide_) return;
    auto* r = reinterpret_cast<U8*>(record.data());
    std::memcpy(r, point_, 14);
    r[14] = point_[24];
    r[15] = static_cast<U8>(point_[22] >> 4 | (point_[22] >> 2 & 3) << 4 | (point_[14] & 0xC0));
    r[16] = point_[23];
    r[17] = point_[17];
    std::memcpy(r + 18, point_ + 20, 2);
    std::memcpy(r + 20, point_ + 18, 2);
    std::memcpy(r + 22, point_ + 32, 8);
  }

 private:
  const LASzip& laszip_;
  bool wide_;
  alignas(8) U8 point_[128] = {};
  U8* items_[8] = {};
};

struct LazSpec {
  unsigned version = 0;             ///< of the items; 0: the usual one
  std::uint32_t chunk_points = 40;  ///< 0: of varying numbers
  bool streamed = false;            ///< the table's place stands at the end of the file
  bool pointwise = false;           ///< in one piece without a table, as LASzip wrote before 2.0
};

/// The LAS file as LASzip compresses it.
inline std::string make_laz(const std::string& las, const LazSpec& spec) {
  LASzip laszip;
  const unsigned format = static_cast<unsigned char>(las[104]);
  const std::size_t length = las_record_length(las), begin = las_points_begin(las);
  const auto count = static_cast<std::size_t>(las_count(las));
  const bool layered = format >= 6;
  if (!laszip.setup(static_cast<U8>(format), static_cast<U16>(length),
                    layered          ? LASZIP_COMPRESSOR_LAYERED_CHUNKED
                    : spec.pointwise ? LASZIP_COMPRESSOR_POINTWISE
                                     : LASZIP_COMPRESSOR_CHUNKED)) {
    throw std::runtime_error("LASzip refuses the format");
  }
  if (spec.version != 0) laszip.request_version(static_cast<U16>(spec.version));
  laszip.set_chunk_size(spec.chunk_points == 0 ? U32_MAX : spec.chunk_points);
  U8* packed = nullptr;
  int size = 0;
  laszip.pack(packed, size);

  const std::size_t gap = begin - 7 < las.size() && las.compare(begin - 7, 7, "padding") == 0 ? 7 : 0;
  std::string file = las.substr(0, begin - gap);
  file += las_record("laszip encoded", 22204,
                     std::string(reinterpret_cast<char*>(packed), static_cast<std::size_t>(size)), false);
  file += las.substr(begin - gap, gap);
  las_put(file, 100, las_get<std::uint32_t>(file, 100) + 1);
  las_put(file, 96, static_cast<std::uint32_t>(file.size()));
  file[104] = static_cast<char>(format | 0x80);

  LazBytesOut out(file, !spec.streamed);
  LASwritePoint writer;
  writer.setup(laszip.num_items, laszip.items, &laszip);
  writer.init(&out);
  LazPoint point(laszip);
  std::size_t in_chunk = 0;
  for (std::size_t i = 0; i < count; ++i) {
    std::string record = las.substr(begin + i * length, length);
    point.take(record);
    writer.write(point.items(record));
    if (spec.chunk_points == 0 && ++in_chunk == 1 + i % 37 && i + 1 < count) {
      writer.chunk();
      in_chunk = 0;
    }
  }
  writer.done();
  const std::size_t tail = file.size();
  file += las.substr(begin + count * length);
  if (las[25] >= 4 && las_get<std::uint32_t>(las, 243) != 0) {
    const std::uint64_t moved = tail - (begin + count * length);
    las_put(file, 235, las_get<std::uint64_t>(las, 235) + moved);
    if (las_get<std::uint64_t>(las, 227) != 0) las_put(file, 227, las_get<std::uint64_t>(las, 227) + moved);
  }
  return file;
}

inline std::string laszip_record(const std::string& laz) {
  std::size_t at = las_get<std::uint16_t>(laz, 94);
  for (std::uint32_t i = 0; i < las_get<std::uint32_t>(laz, 100); ++i) {
    const std::size_t size = las_get<std::uint16_t>(laz, at + 20);
    if (las_get<std::uint16_t>(laz, at + 18) == 22204) return laz.substr(at + 54, size);
    at += 54 + size;
  }
  throw std::runtime_error("the file has no LASzip record");
}

/// The records of a LAZ file as LASzip reads them, with its own search for the chunks.
inline std::string laz_records(const std::string& laz) {
  const std::string packed = laszip_record(laz);
  LASzip laszip;
  if (!laszip.unpack(reinterpret_cast<const U8*>(packed.data()), static_cast<int>(packed.size())))
    throw std::runtime_error("LASzip refuses the record");
  LazBytesIn in(laz);
  in.seek(static_cast<I64>(las_points_begin(laz)));
  LASreadPoint reader;
  reader.setup(laszip.num_items, laszip.items, &laszip);
  reader.init(&in);
  LazPoint point(laszip);
  std::string records, record(las_record_length(laz), '\0');
  for (std::uint64_t i = 0; i < las_count(laz); ++i) {
    if (!reader.read(point.items(record))) throw std::runtime_error(reader.error() ? reader.error() : "LASzip fails");
    point.give(record);
    records += record;
  }
  if (!reader.check_end()) throw std::runtime_error("LASzip finds a chunk of another length");
  return records;
}

/// Of a cloud whose last chunk is to stay as it is.
inline void move_some(Cloud& cloud) {
  for (std::size_t i = 0; i < cloud.points.size(); ++i) {
    if (i % 3 == 0 || i >= 90) continue;  // the last chunk stays as it is
    cloud.points[i].x += 0.5F * static_cast<float>(i % 5);
    cloud.points[i].z -= 0.25F * static_cast<float>(i % 3);
  }
}

}  // namespace pointfair::test
