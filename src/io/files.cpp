// SPDX-License-Identifier: Apache-2.0
// Writing whole files: chooses the format, and hands over to its writer.
#include <cmath>
#include <cstdio>
#include <utility>

#include "io/contents.hpp"
#include "io/detect.hpp"
#include "io/formats.hpp"
#include "io/parallel.hpp"
#include "io/streamed.hpp"
#include "io/text.hpp"
#include "platform/path_text.hpp"
#include "pointfair/file_info.hpp"
#include "pointfair/io.hpp"

namespace pointfair {
namespace {

[[noreturn]] void refuse(const std::string& message) { throw Error(ErrorKind::usage, message); }

void check(const Cloud& cloud) {
  if (cloud.points.empty()) refuse("the cloud has no points, so there is nothing to write");
  io::check_has_points_of_file(cloud);
  for (const Attribute& added : cloud.added) {
    if (added.components == 0 || added.data.size() != cloud.points.size() * added.components * size_of(added.type))
      refuse("the attribute '" + added.name + "' does not have one value for each point");
  }
}

bool has_encoding(Format format, Encoding encoding) {
  return (io::row_of(format).encodings >> static_cast<unsigned>(encoding) & 1u) != 0;
}

[[noreturn]] void refuse_encoding(Format format) {
  constexpr std::pair<Encoding, const char*> kEncodings[] = {{Encoding::ascii, "ascii"},
                                                             {Encoding::binary, "binary"},
                                                             {Encoding::binary_big_endian, "binary-big-endian"},
                                                             {Encoding::binary_compressed, "binary-compressed"}};
  std::string known;
  for (const auto& [encoding, name] : kEncodings)
    if (has_encoding(format, encoding)) known += (known.empty() ? "" : ", ") + std::string(name);
  refuse("the format has no such encoding; it has " + known);
}

// What a new file is written in.
Encoding usual_encoding(Format format) {
  for (const Encoding encoding : {Encoding::binary, Encoding::ascii})
    if (has_encoding(format, encoding)) return encoding;
  return Encoding::binary_compressed;
}

// What is written where: decided, and refused, before the output is opened.
struct Plan {
  Format format;
  Encoding encoding;
  bool copy;  // into the source's own format
  io::Edits edits;
};

// By way of a LAS file, so that what one keeps, such as the coordinate system, is kept.
void write_octree(const Plan& plan, const Cloud& cloud, io::Output& out) {
  io::MemoryOutput las;
  if (io::is_of(cloud, Format::las) && cloud.source->holds_its_positions()) {
    cloud.source->write(plan.edits, Encoding::binary, las);
  } else {
    io::write_las(io::make_table(cloud), {Format::las, Encoding::binary, plan.edits.las_scale}, las);
  }
  io::write_copc(las.bytes, cloud.source ? cloud.source->name() : "the cloud", out);
}

void write_new(const Plan& plan, const Cloud& cloud, io::Output& out) {
  if (plan.format == Format::copc) return write_octree(plan, cloud, out);
  io::row_of(plan.format).write(io::make_table(cloud), {plan.format, plan.encoding, plan.edits.las_scale}, out);
}

// Whoever reads an E57 file takes its coordinates for metres.
void check_metres(const Cloud& cloud) {
  const FileInfo info = cloud.source ? cloud.source->info() : FileInfo{};
  const double unit = info.metres_per_unit.value_or(1);
  if (!info.is_geographic && std::abs(unit - 1) < 1e-6) return;
  char length[32];
  std::snprintf(length, sizeof length, "%.7g m", unit);
  refuse(std::string("E57 files are in metres, and the unit of this cloud is ") +
         (info.is_geographic ? "a degree" : length) + "; choose LAZ or PLY, or convert it to metres first");
}

// Refuses what no new file of the format can be made of.
void check_new(const Cloud& cloud, Format format) {
  if (format == Format::e57) check_metres(cloud);
  if (format == Format::stl) io::check_new_stl(cloud);
  if (format == Format::copc) io::check_new_copc(cloud);
  if (format == Format::kitti || format == Format::nuscenes)
    refuse("files of KITTI and nuScenes are written from such files only, with moved points; choose NPY or PLY");
}

Plan plan(const Cloud& cloud, Format format, std::optional<Encoding> encoding, std::optional<double> las_scale) {
  const bool keeps = io::is_of(cloud, format) && has_encoding(format, cloud.source->encoding());
  const bool copy = io::is_copied(cloud, format, encoding);
  if (format == Format::glb) refuse("glTF files are read, not written; choose PLY, OBJ or STL");
  if (!copy) check_new(cloud, format);
  const Plan result{format, encoding.value_or(keeps ? cloud.source->encoding() : usual_encoding(format)), copy,
                    io::make_edits(cloud, las_scale)};
  if (las_scale && io::family(format) != Format::las && format != Format::copc)
    refuse("only LAS and LAZ files have a scale; leave it out");
  const bool is_edited = copy || (format == Format::copc && io::is_of(cloud, Format::las));
  if (las_scale && is_edited) cloud.source->check_las_scale(*las_scale);
  if (!has_encoding(format, result.encoding)) refuse_encoding(format);
  for (const io::Replacement& replacement : result.edits.replaced) {
    const std::string why = copy ? cloud.source->why_fixed(replacement.column) : std::string();
    if (!why.empty()) refuse(why);
    if (is_edited) io::check_fits(replacement, *cloud.source);
  }
  return result;
}

Plan plan(const std::filesystem::path& path, const Cloud& cloud, const WriteOptions& options) {
  const std::optional<Format> own = cloud.source ? std::optional(cloud.source->format()) : std::nullopt;
  const Format format = options.format ? *options.format : format_to_write(path, own);
  check(cloud);
  const Plan chosen = plan(cloud, format, options.encoding, options.las_scale);  // a file that cannot be loses nothing
  if (options.strict) io::refuse_losses(path, losses(cloud, format, options.encoding));
  return chosen;
}

void carry_out(const Plan& plan, const Cloud& cloud, unsigned threads, io::Output& out) {
  io::with_threads(
      threads, [&] { plan.copy ? cloud.source->write(plan.edits, plan.encoding, out) : write_new(plan, cloud, out); });
}

// Files that belong to the source's, each with what it is called beside the output. Those that are there already, since
// the output lies beside the source and has its name, are left out.
std::vector<std::pair<std::filesystem::path, std::filesystem::path>> companions(const Plan& plan, const Cloud& cloud,
                                                                                const std::filesystem::path& output) {
  std::vector<std::pair<std::filesystem::path, std::filesystem::path>> result;
  if (!plan.copy || output == "-") return result;
  std::error_code ignored;
  for (const std::string& extension : cloud.source->companions()) {
    std::filesystem::path from = io::companion_of(*cloud.source, extension), to(output);
    to.replace_extension(from.extension());
    if (from.empty() || std::filesystem::equivalent(from, to, ignored)) continue;
    result.emplace_back(std::move(from), std::move(to));
  }
  return result;
}

// All files get their names, or none does.
void write_all(const Plan& plan, const Cloud& cloud, const std::filesystem::path& path, const WriteOptions& options) {
  std::vector<std::unique_ptr<io::Output>> outputs;
  outputs.push_back(io::open_output(path, options.overwrite, options.sync));
  carry_out(plan, cloud, options.threads, *outputs.front());
  for (const auto& [from, to] : companions(plan, cloud, path)) {
    outputs.push_back(io::open_output(to, options.overwrite, options.sync));
    outputs.back()->write(io::FileBytes::open(from).view());
  }
  for (const auto& output : outputs) output->require_room();
  for (const auto& output : outputs) output->finish();
}

}  // namespace

void check_write(const std::filesystem::path& path, const Cloud& cloud, const WriteOptions& options) {
  const Plan chosen = plan(path, cloud, options);
  const bool is_new_octree = chosen.format == Format::copc && !io::is_of(cloud, Format::las);
  if (is_new_octree || (!chosen.copy && io::family(chosen.format) == Format::las))
    io::check_new_las(cloud, options.las_scale);
  for (const auto& [from, to] : companions(chosen, cloud, path)) {
    if (!options.overwrite && std::filesystem::exists(to))
      io::fail(platform::text_of(to),
               "exists already, and " + platform::text_of(from) + " is to be copied there; choose another name");
  }
}

void write(const std::filesystem::path& path, const Cloud& cloud, const WriteOptions& options) {
  write_all(plan(path, cloud, options), cloud, path, options);
}

namespace io {

namespace {

// A cloud of the source without its points, with an attribute without values; no name: without one.
Cloud shell_of(const std::shared_ptr<const Source>& source, const std::string& added = {}) {
  Cloud shell{.origin = source->origin(), .source = source};
  if (!added.empty()) shell.added.push_back({{added, ScalarType::uint8}, {}});
  return shell;
}

std::shared_ptr<const Source> unowned(const Source& source) { return {std::shared_ptr<const Source>(), &source}; }

Plan streamed_plan(const Cloud& shell, const std::filesystem::path& path, const WriteOptions& options) {
  const Format format = options.format ? *options.format : format_to_write(path, shell.source->format());
  return plan(shell, format, options.encoding, options.las_scale);
}

std::string why_not_streamed(const Plan& chosen, const Source& source, const std::filesystem::path& path) {
  const bool transcodes =
      chosen.encoding != source.encoding() && io::family(chosen.format) != Format::las && chosen.format != Format::ply;
  if (chosen.copy && !transcodes) return {};
  const std::string begin = platform::text_of(path) + ": a cloud that is computed in tiles on disk ";
  if (chosen.copy) return begin + "keeps the encoding of its file; leave out --encoding, and convert it afterwards";
  if (chosen.format == source.format() && !chosen.edits.added.empty())
    return begin + "takes no further attributes in " + row_of(chosen.format).name +
           " files, so outliers cannot be marked; use --outliers keep";
  return begin + "is written as " + row_of(source.format()).name + "; name the output so, and convert it afterwards";
}

}  // namespace

std::string why_not_streamed(const Source& source, const std::filesystem::path& path, const WriteOptions& options,
                             const std::string& added) {
  const Cloud shell = shell_of(unowned(source), added);
  const Plan chosen = streamed_plan(shell, path, options);
  const std::string why = why_not_streamed(chosen, source, path);
  if (why.empty() && !added.empty() && !takes_attributes(chosen.format))
    return "files of this format take no further attributes, so outliers cannot be marked; use --outliers keep";
  return why;
}

std::vector<std::string> losses_when_streamed(const Source& source, const std::filesystem::path& path,
                                              const WriteOptions& options, const std::string& added) {
  const Cloud shell = shell_of(unowned(source), added);
  return losses(shell, streamed_plan(shell, path, options).format, options.encoding);
}

void refuse_losses(const std::filesystem::path& path, const std::vector<std::string>& lost) {
  if (lost.empty()) return;
  const std::string more = lost.size() > 1 ? " (and " + std::to_string(lost.size() - 1) + " more)" : "";
  fail(platform::text_of(path), lost.front() + more + "; choose another format, or leave out --strict");
}

void write_moved(const std::filesystem::path& path, const std::shared_ptr<Source>& source, const MovedPoints& moved,
                 const WriteOptions& options, std::vector<Attribute> added, std::span<const std::uint8_t> removed) {
  Cloud shell = shell_of(source);
  shell.added = std::move(added);
  Plan chosen = streamed_plan(shell, path, options);
  if (const std::string why = why_not_streamed(chosen, *source, path); !why.empty()) refuse(why);
  chosen.edits.moved = &moved;
  chosen.edits.removed = removed;
  write_all(chosen, shell, path, options);
}

}  // namespace io

Format format_to_write(const std::filesystem::path& path, std::optional<Format> source) {
  const std::string name = io::shown_name(path, false);
  if (io::lower_case(platform::text_of(path.filename())).ends_with(".copc.laz")) return Format::copc;
  std::optional<Format> format = format_of(path);
  const bool are_floats = source == Format::kitti || source == Format::nuscenes;
  const bool is_nameless =
      !path.has_extension() || (are_floats && io::lower_case(platform::text_of(path.extension())) == ".bin");
  if (!format && is_nameless) format = source;
  if (!format) io::fail(name, std::string("unknown extension; name the file ") + io::kWrittenExtensions);
  return *format;
}

std::vector<std::byte> write_bytes(const Cloud& cloud, Format format, std::optional<Encoding> encoding) {
  check(cloud);
  io::MemoryOutput out;
  carry_out(plan(cloud, format, encoding, {}), cloud, 0, out);
  const auto* const begin = reinterpret_cast<const std::byte*>(out.bytes.data());
  return {begin, begin + out.bytes.size()};
}

}  // namespace pointfair
