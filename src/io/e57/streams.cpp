// SPDX-License-Identifier: Apache-2.0
#include "io/e57/streams.hpp"

#include <algorithm>

#include "io/e57/pages.hpp"
#include "io/file_bytes.hpp"
#include "io/scalar.hpp"

namespace pointfair::io::e57 {
namespace {

constexpr std::size_t kSectionHeader = 32, kPacketHeader = 6;
constexpr unsigned char kPointsSection = 1, kDataPacket = 1;

class PacketReader {
 public:
  PacketReader(std::string_view file, const Scan& scan, std::size_t index, const std::string& name)
      : file_(file), scan_(scan), index_(index), name_(name), size_(file.size() / kPage * kPayload) {}

  std::vector<std::vector<Piece>> read(std::uint64_t& left) {
    streams_.resize(scan_.fields.size());
    if (scan_.records == 0) return std::move(streams_);
    const auto [begin, end] = section();
    if (end - scan_.section_begin > left) fail_damaged();
    left -= end - scan_.section_begin;
    for (std::uint64_t at = begin; at < end && !is_complete();) at += read_packet(at, end);
    if (!is_complete())
      fail(name_, "scan " + std::to_string(index_) + " promises " + std::to_string(scan_.records) +
                      " points, its packets hold fewer; copy the file again");
    return std::move(streams_);
  }

 private:
  [[noreturn]] void fail_damaged() const {
    fail(name_, "the packets of scan " + std::to_string(index_) + " are damaged; copy the file again");
  }

  template <class T>
  T get(std::uint64_t at) const {
    if (at + sizeof(T) > size_) fail_damaged();
    char bytes[sizeof(T)];
    read_pages(file_, 0, at, sizeof(T), bytes);
    return load_little<T>(bytes);
  }

  // Where its packets begin and end.
  std::pair<std::uint64_t, std::uint64_t> section() const {
    const std::uint64_t begin = scan_.section_begin;
    if (begin > size_ || size_ - begin < kSectionHeader || get<unsigned char>(begin) != kPointsSection) fail_damaged();
    const auto length = get<std::uint64_t>(begin + 8);
    const std::uint64_t data = to_logical(get<std::uint64_t>(begin + 16));
    if (length > size_ - begin || data < begin + kSectionHeader || data > begin + length) fail_damaged();
    return {data, begin + length};
  }

  // Returns its length.
  std::uint64_t read_packet(std::uint64_t at, std::uint64_t end) {
    const std::uint64_t length = std::uint64_t{get<std::uint16_t>(at + 2)} + 1;
    if (length > end - at || length < 4) fail_damaged();
    if (get<unsigned char>(at) != kDataPacket) return length;
    const std::size_t count = get<std::uint16_t>(at + 4);
    if (count != streams_.size() || kPacketHeader + 2 * count > length) fail_damaged();
    std::uint64_t place = at + kPacketHeader + 2 * count;
    for (std::size_t f = 0; f < count; ++f) {
      const std::uint32_t size = get<std::uint16_t>(at + kPacketHeader + 2 * f);
      if (size > at + length - place) fail_damaged();
      if (size > 0) streams_[f].push_back({streams_[f].empty() ? 0 : streams_[f].back().end(), place, size});
      place += size;
    }
    return length;
  }

  bool is_complete() const {
    for (std::size_t f = 0; f < streams_.size(); ++f) {
      const std::uint64_t bits = scan_.fields[f].bits;
      const std::uint64_t held = streams_[f].empty() ? 0 : streams_[f].back().end();
      if (bits != 0 && held * 8 / bits < scan_.records) return false;
    }
    return true;
  }

  std::string_view file_;
  const Scan& scan_;
  std::size_t index_;
  const std::string& name_;
  std::uint64_t size_;  // of the file, logical
  std::vector<std::vector<Piece>> streams_;
};

}  // namespace

std::vector<std::vector<Piece>> find_streams(std::string_view file, const Scan& scan, std::size_t index,
                                             std::uint64_t& left, const std::string& name) {
  return PacketReader(file, scan, index, name).read(left);
}

void read_stream(std::string_view file, const std::vector<Piece>& pieces, std::uint64_t begin, std::uint64_t end,
                 std::string& to) {
  to.resize(static_cast<std::size_t>(end - begin));
  auto piece = std::ranges::upper_bound(pieces, begin, {}, &Piece::end);
  for (std::uint64_t at = begin; at < end; ++piece) {
    const std::uint64_t run = std::min(end, piece->end()) - at;
    read_pages(file, 0, piece->place + (at - piece->begin), static_cast<std::size_t>(run), to.data() + (at - begin));
    at += run;
  }
}

}  // namespace pointfair::io::e57
