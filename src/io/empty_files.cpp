// SPDX-License-Identifier: Apache-2.0
#include "pointfair/empty_files.hpp"

#include <memory>
#include <optional>
#include <string_view>

#include "io/detect.hpp"
#include "io/file_bytes.hpp"
#include "io/no_points.hpp"
#include "io/output.hpp"

namespace pointfair {

namespace {

// Throws NoPoints unless the file is to be written in its own format.
void check_format(std::string_view bytes, const std::filesystem::path& from, const std::filesystem::path& to,
                  const WriteOptions& options) {
  const std::optional<Format> own = io::format_of_content(bytes), named = format_of(from);
  const Format wanted = options.format ? *options.format : format_to_write(to, own ? own : named);
  // an octree without points is none, and its file is called as others are
  const auto is_wanted = [wanted](std::optional<Format> format) {
    return format == wanted || (format == Format::laz && wanted == Format::copc) ||
           (format == Format::copc && wanted == Format::laz);
  };
  if ((!is_wanted(own) && !is_wanted(named)) || options.encoding)
    throw NoPoints(io::shown_name(from, true) +
                   ": has no points, and such a file is written in its own format and encoding only; leave it out");
}

}  // namespace

void copy_without_points(const std::filesystem::path& from, const std::filesystem::path& to,
                         const WriteOptions& options) {
  const io::FileBytes bytes = io::FileBytes::open(from);
  check_format(bytes.view(), from, to, options);
  const std::unique_ptr<io::Output> out = io::open_output(to, options.overwrite, options.sync);
  out->write(bytes.view());
  out->require_room();
  out->finish();
}

namespace io {

void check_copy_without_points(const std::filesystem::path& from, const std::filesystem::path& to,
                               const WriteOptions& options) {
  check_format(FileBytes::open(from).view(), from, to, options);
}

}  // namespace io

}  // namespace pointfair
