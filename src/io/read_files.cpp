// SPDX-License-Identifier: Apache-2.0
// Reading whole files: chooses the format, and hands over to its reader.
#include <utility>

#include "io/detect.hpp"
#include "io/formats.hpp"
#include "io/parallel.hpp"
#include "io/pcd_header.hpp"
#include "io/streamed.hpp"
#include "platform/files.hpp"
#include "pointfair/io.hpp"

namespace pointfair {
namespace {

// Files that are often taken for others: packed ones, and what stands in their place in a repository.
void check_unpacked(std::string_view bytes, const std::string& name) {
  constexpr std::pair<std::string_view, const char*> kPacked[] = {
      {"\x1F\x8B", "is packed by gzip; unpack it first, as gunzip does"},
      {"PK\x03\x04", "is a ZIP archive; unpack it first"},
      {"\xFD"
       "7zXZ",
       "is packed by xz; unpack it first, as unxz does"},
      {"BZh", "is packed by bzip2; unpack it first, as bunzip2 does"},
      {"\x28\xB5\x2F\xFD", "is packed by zstd; unpack it first, as unzstd does"},
      {"version https://git-lfs", "only stands for a file that Git LFS holds; fetch that, as git lfs pull does"}};
  for (const auto& [front, message] : kPacked)
    if (bytes.starts_with(front)) io::fail(name, message);
}

Format choose_format(std::string_view bytes, const std::string& name, const ReadOptions& options) {
  check_unpacked(bytes, name);
  if (options.format) return *options.format;
  if (const auto format = io::format_of_content(bytes)) return *format;
  const std::filesystem::path path(name);
  if (const auto format = format_of(path)) return *format;
  if (!path.has_extension() && io::looks_like_numbers(bytes)) return Format::xyz;
  if (path.extension() == ".bin")
    io::fail(name, "does not say what it holds: give --in-format kitti or nuscenes where it is a frame of these");
  io::fail(name, std::string("unknown format; say which it is (--in-format), or name the file ") +
                     io::kKnownExtensions +
                     "; a format of another program is to be exported from there, as E57, LAS or PLY");
}

// Refuses --columns and --skip where there are no columns, and text in which every letter takes two bytes.
void check_text(std::string_view bytes, const std::string& name, Format format, const ReadOptions& options) {
  const bool has_columns = io::row_of(format).read == io::read_xyz;
  if (!has_columns && (!options.columns.empty() || options.skip_lines > 0))
    throw Error(ErrorKind::usage,
                name + ": --columns and --skip are for text files with columns of numbers; leave them out");
  const auto is_zero = [&](std::size_t at) { return at < bytes.size() && bytes[at] == '\0'; };
  const bool is_wide = is_zero(0) != is_zero(1) && is_zero(0) == is_zero(2) && is_zero(1) == is_zero(3);
  if (bytes.starts_with("\xFF\xFE") || bytes.starts_with("\xFE\xFF") || (has_columns && is_wide))
    io::fail(name, "is text in UTF-16; convert it to UTF-8, as iconv -f UTF-16 -t UTF-8 does");
}

std::shared_ptr<Source> parse(io::FileBytes bytes, const std::string& name, Format format, const ReadOptions& options,
                              io::Residence residence = io::Residence::memory) {
  check_text(bytes.view(), name, format, options);
  return io::row_of(format).read(std::move(bytes), name, {format, options, residence});
}

Cloud read_bytes(io::FileBytes bytes, const std::string& name, const ReadOptions& options) {
  if (bytes.view().empty()) io::fail(name, "is empty; copy the file again or choose another");
  const Format format = choose_format(bytes.view(), name, options);
  return io::with_threads(options.threads, [&] {
    const std::shared_ptr<Source> source = parse(std::move(bytes), name, format, options);
    std::vector<Point> points = source->place();
    return Cloud{.origin = source->origin(), .points = std::move(points), .source = source};
  });
}

}  // namespace

Cloud read(const std::filesystem::path& path, const ReadOptions& options) {
  return read_bytes(io::FileBytes::open(path), io::shown_name(path, true), options);
}

Cloud read(std::span<const std::byte> bytes, const std::string& name, const ReadOptions& options) {
  return read_bytes(io::FileBytes::copy(bytes), name, options);
}

namespace io {

bool is_stream(const std::filesystem::path& path) {
  if (path == "-") return true;
  const auto status = platform::status_of(path);
  return status && status->kind == platform::FileStatus::Kind::other;
}

std::shared_ptr<Source> open_source(const std::filesystem::path& path, unsigned threads) {
  const std::string name = shown_name(path, true);
  FileBytes bytes = FileBytes::open(path);
  if (bytes.view().empty()) fail(name, "is empty; copy the file again or choose another");
  const Format format = choose_format(bytes.view(), name, {});
  if (format == Format::pcd && parse_pcd_header(bytes.view(), name).encoding == Encoding::binary_compressed)
    fail(name,
         "a compressed PCD file is one whole that cannot be read in parts; convert it to PCD binary, or run it "
         "in memory");
  return with_threads(threads, [&] { return parse(std::move(bytes), name, format, {}, Residence::file); });
}

}  // namespace io
}  // namespace pointfair
