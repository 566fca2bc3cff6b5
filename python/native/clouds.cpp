// SPDX-License-Identifier: Apache-2.0
// Files and clouds with attributes.
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "bindings.hpp"

namespace nb = nanobind;

namespace pointfair::python {
namespace {

constexpr const char* kTypes[] = {"int8", "uint8", "int16", "uint16", "int32", "uint32", "float32", "float64"};

const char* name_of(ScalarType type) { return kTypes[static_cast<std::size_t>(type)]; }

std::optional<Format> format_named(const std::optional<std::string>& name) {
  if (!name) return std::nullopt;
  const std::optional<Format> format = format_of("file." + *name);
  if (!format) throw Error(ErrorKind::usage, "format cannot be '" + *name + "': give an extension, such as ply");
  return format;
}

std::optional<Encoding> encoding_named(const std::optional<std::string>& name) {
  if (!name) return std::nullopt;
  constexpr const char* kNames[] = {"ascii", "binary", "binary-big-endian", "binary-compressed"};
  for (std::size_t i = 0; i < std::size(kNames); ++i)
    if (*name == kNames[i]) return static_cast<Encoding>(i);
  throw Error(ErrorKind::usage,
              "encoding cannot be '" + *name + "': give ascii, binary, binary-big-endian or binary-compressed");
}

// Names of files are bytes; not all are UTF-8.
std::string path_of(const nb::bytes& path) { return {path.c_str(), path.size()}; }

Cloud read_file(nb::bytes path, const std::optional<std::string>& format, const std::vector<std::string>& columns,
                std::uint64_t skip, unsigned threads) {
  ReadOptions options{.format = format_named(format), .threads = threads, .columns = columns, .skip_lines = skip};
  const std::filesystem::path file(path_of(path));
  nb::gil_scoped_release release;
  return read(file, options);
}

Cloud read_memory(nb::bytes bytes, const std::string& name, const std::optional<std::string>& format) {
  ReadOptions options{.format = format_named(format)};
  const auto span = std::as_bytes(std::span(bytes.c_str(), bytes.size()));
  nb::gil_scoped_release release;
  return read(span, name, options);
}

// What the file could not keep, a sentence each.
std::vector<std::string> write_file(const Cloud& cloud, nb::bytes path, const std::optional<std::string>& format,
                                    const std::optional<std::string>& encoding, bool overwrite, bool strict,
                                    unsigned threads) {
  WriteOptions options{.format = format_named(format),
                       .encoding = encoding_named(encoding),
                       .overwrite = overwrite,
                       .strict = strict,
                       .threads = threads};
  const std::filesystem::path file(path_of(path));
  nb::gil_scoped_release release;
  write(file, cloud, options);
  std::vector<std::string> notes = losses(
      cloud, options.format ? *options.format : format_to_write(file, file_info(cloud).format), options.encoding);
  std::ranges::transform(notes, notes.begin(), in_python);
  return notes;
}

nb::bytes write_memory(const Cloud& cloud, const std::string& format, const std::optional<std::string>& encoding) {
  std::vector<std::byte> bytes;
  {
    nb::gil_scoped_release release;
    bytes = write_bytes(cloud, format_named(format).value(), encoding_named(encoding));
  }
  return nb::bytes(bytes.data(), bytes.size());
}

void copy_positions(const Cloud& cloud, const Output<double>& out) {
  const std::span<Position> span(reinterpret_cast<Position*>(out.data()), out.shape(0));
  nb::gil_scoped_release release;
  positions(cloud, span);
}

void replace_positions(Cloud& cloud, const Input<double>& coordinates) {
  const std::span<const Position> wanted(reinterpret_cast<const Position*>(coordinates.data()), coordinates.shape(0));
  nb::gil_scoped_release release;
  set_positions(cloud, wanted);
}

// Rows and points a row of an organised cloud.
std::optional<std::pair<std::uint64_t, std::uint64_t>> grid_of(const Cloud& cloud) {
  const FileInfo info = file_info(cloud);
  if (info.grid_width == 0) return std::nullopt;
  return std::pair(info.grid_height, info.grid_width);
}

// Names of attributes are bytes here: those of text files may be Latin-1.
std::string text_of(const nb::bytes& name) { return {name.c_str(), name.size()}; }

Rows attribute_list(const Cloud& cloud) {
  Rows rows;
  for (const AttributeInfo& info : attributes(cloud))
    rows.append(nb::make_tuple(nb::bytes(info.name.data(), info.name.size()), name_of(info.type), info.components));
  return rows;
}

// (the type's name, components, the bytes)
Row row_of(Attribute&& attribute) {
  auto values = std::make_unique<Attribute>(std::move(attribute));
  const std::size_t size = values->data.size();
  Attribute* const raw = values.get();
  nb::capsule owner(values.release(), [](void* pointer) noexcept { delete static_cast<Attribute*>(pointer); });
  const nb::ndarray<nb::numpy, std::uint8_t, nb::ndim<1>> bytes(raw->data.data(), {size}, owner);
  return nb::make_tuple(name_of(raw->type), raw->components, bytes);
}

// One for each name.
Rows values_of(const Cloud& cloud, const std::vector<nb::bytes>& wanted) {
  std::vector<std::string> names;
  for (const nb::bytes& name : wanted) names.push_back(text_of(name));
  std::vector<Attribute> values;
  {
    nb::gil_scoped_release release;
    values = attribute_values(cloud, names);
  }
  Rows rows;
  for (Attribute& attribute : values) rows.append(row_of(std::move(attribute)));
  return rows;
}

void set_attribute(Cloud& cloud, const nb::bytes& of, const std::string& type, std::uint32_t components,
                   const Mask& bytes) {
  const std::string name = text_of(of);
  Attribute attribute;
  attribute.name = name;
  const auto found = std::ranges::find(kTypes, type);
  attribute.type = static_cast<ScalarType>(found - std::begin(kTypes));
  attribute.components = components;
  const auto data = std::as_bytes(span_of(bytes));
  attribute.data.assign(data.begin(), data.end());
  for (Attribute& added : cloud.added) {
    if (added.name == name) {
      added = std::move(attribute);
      return;
    }
  }
  cloud.added.push_back(std::move(attribute));
}

nb::ndarray<nb::numpy, std::uint32_t, nb::shape<-1, 3>> triangle_array(const Cloud& cloud) {
  using Triangles = std::vector<std::array<std::uint32_t, 3>>;
  auto* const found = new Triangles();
  nb::capsule owner(found, [](void* pointer) noexcept { delete static_cast<Triangles*>(pointer); });
  {
    nb::gil_scoped_release release;
    *found = triangles(cloud);
  }
  return {reinterpret_cast<std::uint32_t*>(found->data()), {found->size(), 3}, owner};
}

}  // namespace

void bind_clouds(nb::module_& module) {
  nb::class_<Cloud>(module, "Cloud")
      .def(nb::init<>())
      .def("__len__", [](const Cloud& self) { return self.points.size(); })
      .def("copy", [](const Cloud& self) { return Cloud(self); })
      .def_prop_ro("position_type", [](const Cloud& self) { return name_of(position_type(self)); })
      .def("positions", &copy_positions, nb::arg("out").noconvert())
      .def("replace_positions", &replace_positions, nb::arg("coordinates").noconvert())
      .def("attributes", &attribute_list)
      .def("values", &values_of, nb::arg("names"))
      .def("set_attribute", &set_attribute, nb::arg("name"), nb::arg("type"), nb::arg("components"),
           nb::arg("bytes").noconvert())
      .def_prop_ro("grid", &grid_of)
      .def("triangles", &triangle_array)
      .def("write", &write_file, nb::arg("path"), nb::arg("format").none(), nb::arg("encoding").none(),
           nb::arg("overwrite"), nb::arg("strict"), nb::arg("threads"))
      .def("write_bytes", &write_memory, nb::arg("format"), nb::arg("encoding").none());
  module.def("read", &read_file, nb::arg("path"), nb::arg("format").none(), nb::arg("columns"), nb::arg("skip"),
             nb::arg("threads"));
  module.def("read_bytes", &read_memory, nb::arg("data"), nb::arg("name"), nb::arg("format").none());
}

}  // namespace pointfair::python
