// SPDX-License-Identifier: Apache-2.0
// Reading the meshes of glTF files: their vertices as points in the coordinates of the scene, their triangles as faces.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <optional>

#include "io/formats.hpp"
#include "io/gltf/contents.hpp"
#include "io/gltf/document.hpp"

namespace pointfair::io {
namespace gltf {
namespace {

constexpr int kDeepest = 200;  // nodes within nodes

// The upper three rows of a matrix.
struct Transform {
  std::array<std::array<double, 4>, 3> rows{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};

  bool operator==(const Transform&) const = default;
  Position moved(const Position& v) const {
    Position result;
    for (std::size_t r = 0; r < 3; ++r)
      result[r] = rows[r][0] * v[0] + rows[r][1] * v[1] + rows[r][2] * v[2] + rows[r][3];
    return result;
  }
  Transform then(const Transform& inner) const {
    Transform result;
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t c = 0; c < 4; ++c)
        result.rows[r][c] = rows[r][0] * inner.rows[0][c] + rows[r][1] * inner.rows[1][c] +
                            rows[r][2] * inner.rows[2][c] + (c == 3 ? rows[r][3] : 0);
    return result;
  }
  // Whether it mirrors, by the determinant: then faces run the other way round.
  bool mirrors() const {
    const Position first = cofactors(0);
    return rows[0][0] * first[0] + rows[0][1] * first[1] + rows[0][2] * first[2] < 0;
  }
  // Normals stay upright on surfaces that are stretched, and outside on those that are mirrored: by the cofactors.
  Position normal(const Position& n) const {
    Position result;
    for (std::size_t r = 0; r < 3; ++r) {
      const Position its = cofactors(r);
      result[r] = n[0] * its[0] + n[1] * its[1] + n[2] * its[2];
    }
    const double length = std::sqrt(result[0] * result[0] + result[1] * result[1] + result[2] * result[2]);
    for (double& value : result) value = length > 0 ? (mirrors() ? -value : value) / length : 0;
    return result;
  }

 private:
  Position cofactors(std::size_t row) const {
    const auto &a = rows[(row + 1) % 3], &b = rows[(row + 2) % 3];
    return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
  }
};

std::vector<double> numbers(const Json& object, const char* key, std::vector<double> absent) {
  const auto found = object.find(key);
  if (found == object.end()) return absent;
  const auto values = found->get<std::vector<double>>();
  if (values.size() != absent.size()) throw std::out_of_range(key);
  return values;
}

Transform transform_of(const Json& node) {
  Transform result;
  if (node.contains("matrix")) {  // column after column
    const std::vector<double> m = numbers(node, "matrix", std::vector<double>(16));
    for (std::size_t r = 0; r < 3; ++r)
      for (std::size_t c = 0; c < 4; ++c) result.rows[r][c] = m[4 * c + r];
    return result;
  }
  const std::vector<double> t = numbers(node, "translation", {0, 0, 0}), s = numbers(node, "scale", {1, 1, 1}),
                            q = numbers(node, "rotation", {0, 0, 0, 1});
  const double x = q[0], y = q[1], z = q[2], w = q[3];
  const std::array<std::array<double, 3>, 3> turn{
      {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
       {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
       {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}}};
  for (std::size_t r = 0; r < 3; ++r) {
    for (std::size_t c = 0; c < 3; ++c) result.rows[r][c] = turn[r][c] * s[c];
    result.rows[r][3] = t[r];
  }
  return result;
}

// Which attributes of the meshes become columns. Their type is that of the first mesh that has them.
struct Wanted {
  const char* attribute;
  std::vector<const char*> names;
};
constexpr const char* kTextureCoordinates = "TEXCOORD_0";
const std::array<Wanted, 3> kWanted = {{{"NORMAL", {"nx", "ny", "nz"}},
                                        {kTextureCoordinates, {"s", "t"}},
                                        {"COLOR_0", {"red", "green", "blue", "alpha"}}}};

class Scene {
 public:
  explicit Scene(const Document& document) : document_(document) {}

  /// Which nodes belong to it, once it was read.
  const std::vector<bool>& visited() const { return visited_; }

  Table read() {
    const Json& json = document_.json();
    const Json scenes = json.value("scenes", Json::array()), nodes = json.value("nodes", Json::array());
    visited_.resize(nodes.size());
    if (!scenes.empty()) {
      const Json& scene = document_.element("scenes", json.value("scene", Json(0U)));
      for (const Json& node : scene.value("nodes", Json::array())) visit(node, {}, 0);
    } else {
      for (const std::size_t root : roots(nodes)) visit(Json(root), {}, 0);
    }
    if (table_.positions.empty()) fail(document_.name(), "has no meshes with points; choose another file");
    for (TableColumn& column : table_.columns) fill_up(column, table_.size());
    table_.coordinate_type = is_moved_ ? ScalarType::float64 : ScalarType::float32;
    return std::move(table_);
  }

 private:
  static std::vector<std::size_t> roots(const Json& nodes) {
    std::vector<bool> is_child(nodes.size());
    for (const Json& node : nodes)
      for (const Json& child : node.value("children", Json::array()))
        if (child.is_number_unsigned() && child.get<std::size_t>() < is_child.size())
          is_child[child.get<std::size_t>()] = true;
    std::vector<std::size_t> result;
    for (std::size_t n = 0; n < is_child.size(); ++n)
      if (!is_child[n]) result.push_back(n);
    return result;
  }

  void visit(const Json& index, const Transform& outer, int depth) {
    const Json& node = document_.element("nodes", index);
    const auto number = index.get<std::size_t>();
    if (visited_[number] || depth > kDeepest)
      fail(document_.name(), "its nodes are no tree, or too deep a one; export it again");
    visited_[number] = true;
    const Transform transform = outer.then(transform_of(node));
    if (const auto mesh = node.find("mesh"); mesh != node.end())
      add_mesh(document_.element("meshes", *mesh), transform);
    for (const Json& child : node.value("children", Json::array())) visit(child, transform, depth + 1);
  }

  void add_mesh(const Json& mesh, const Transform& transform) {
    std::map<std::string, std::size_t> known;  // primitives may share their points
    for (const Json& primitive : mesh.at("primitives")) {
      const Json& attributes = primitive.at("attributes");
      if (!attributes.contains("POSITION")) continue;
      const auto [place, is_new] = known.emplace(attributes.dump(), table_.size());
      const Values positions = document_.values(attributes.at("POSITION"));
      if (positions.components != 3) throw std::out_of_range("POSITION");
      if (is_new) add_points(attributes, positions, transform);
      const bool is_textured = attributes.contains(kTextureCoordinates);
      add_faces(primitive, place->second, positions.count, transform.mirrors());
      table_.faces.materials.resize(table_.faces.ends.size(), is_textured ? material_of(primitive) : kNoMaterial);
    }
  }

  static std::uint32_t material_of(const Json& primitive) {
    const auto found = primitive.find("material");
    const bool is_index = found != primitive.end() && found->is_number_unsigned();
    return is_index ? static_cast<std::uint32_t>(std::min<std::size_t>(found->get<std::size_t>(), kNoMaterial))
                    : kNoMaterial;
  }

  void add_points(const Json& attributes, const Values& positions, const Transform& transform) {
    const std::size_t first = table_.size();
    check_plausible(positions.count, first, 64, document_.file_size(), document_.name());
    if (first + positions.count > 0xFFFFFFFF) fail(document_.name(), "has more points than faces can name");
    is_moved_ = is_moved_ || transform != Transform();
    for (std::size_t i = 0; i < positions.count; ++i)
      table_.positions.push_back(transform.moved({positions.at(i, 0), positions.at(i, 1), positions.at(i, 2)}));
    for (const Wanted& wanted : kWanted) {
      if (!attributes.contains(wanted.attribute)) continue;
      const Values values = document_.values(attributes.at(wanted.attribute));
      const std::size_t least = std::min<std::size_t>(wanted.names.size(), 3);  // colours may be without alpha
      if (values.count != positions.count || values.components < least) throw std::out_of_range("count");
      const bool is_normal = wanted.names[0] == std::string_view("nx");
      for (std::size_t c = 0; c < std::min(wanted.names.size(), values.components); ++c)
        add_values(wanted.names[c], values, first, c, is_normal ? &transform : nullptr);
    }
  }

  // Colours of bytes stay bytes; all else is a float.
  void add_values(const char* name, const Values& values, std::size_t first, std::size_t component,
                  const Transform* transform) {
    auto column = std::ranges::find(table_.columns, name, &TableColumn::name);
    const bool is_byte = values.type == NativeType::uint8 && values.normalized && values.components >= 3;
    if (column == table_.columns.end())
      column = table_.columns.insert(column, zero_column({name, is_byte ? NativeType::uint8 : NativeType::float32}, 0));
    const std::size_t size = size_of(column->type);
    fill_up(*column, first);
    column->data.resize((first + values.count) * size);
    const double factor = full(*column);
    for (std::size_t i = 0; i < values.count; ++i) {
      double value = values.at(i, component);
      if (transform) value = transform->normal({values.at(i, 0), values.at(i, 1), values.at(i, 2)})[component];
      store_double(column->data.data() + (first + i) * size, column->type, false, factor * value);
    }
  }

  static double full(const TableColumn& column) { return column.type == NativeType::uint8 ? 255 : 1; }
  // For the points of meshes without the attribute: no normal, no texture, and white, as glTF says.
  static void fill_up(TableColumn& column, std::size_t points) {
    const std::vector<const char*>& colors = kWanted.back().names;
    const bool is_color = std::ranges::find(colors, column.name) != colors.end();
    const std::size_t size = size_of(column.type);
    std::size_t at = column.data.size();
    column.data.resize(points * size);
    for (; is_color && at < column.data.size(); at += size)
      store_double(column.data.data() + at, column.type, false, full(column));
  }

  void add_faces(const Json& primitive, std::size_t first, std::size_t points, bool mirrored) {
    constexpr unsigned kTriangles = 4, kStrip = 5, kFan = 6;
    const unsigned mode = primitive.value("mode", kTriangles);
    if (mode < kTriangles) return;  // points and lines
    if (mode > kFan) throw std::out_of_range("mode");
    std::optional<Values> indices;
    if (primitive.contains("indices")) indices = document_.values(primitive.at("indices"));
    if (indices && indices->components != 1) throw std::out_of_range("indices");
    const std::size_t count = indices ? indices->count : points;
    const auto corner = [&](std::size_t i) {
      const double index = indices ? indices->at(i, 0) : double(i);
      if (!(index >= 0 && index < double(points)))
        fail(document_.name(), "a triangle has a corner that is no point of its mesh; export it again");
      return static_cast<std::uint32_t>(first + static_cast<std::size_t>(index));
    };
    const std::size_t step = mode == kTriangles ? 3 : 1;
    for (std::size_t i = 0; i + 2 < count; i += step) {
      const bool swaps = (mode == kStrip && i % 2 != 0) != mirrored;
      const std::size_t start = mode == kFan ? 0 : i;
      Faces& faces = table_.faces;
      faces.corners.push_back(corner(swaps ? i + 1 : start));
      faces.corners.push_back(corner(swaps ? start : i + 1));
      faces.corners.push_back(corner(i + 2));
      faces.ends.push_back(faces.corners.size());
    }
  }

  const Document& document_;
  Table table_;
  std::vector<bool> visited_;
  bool is_moved_ = false;
};

// Points that were put together from several parts of the file, and are held in memory. It is read only.
class GltfSource final : public Source {
 public:
  GltfSource(std::string name, Table table, Materials materials, std::vector<Content> contents)
      : Source(FileBytes::copy({}), std::move(name), Format::glb, Encoding::binary),
        table_(std::move(table)),
        materials_(std::move(materials)),
        contents_(std::move(contents)) {}

  std::size_t block_count() const override { return (table_.size() + kBlock - 1) / kBlock; }
  std::uint64_t block_begin(std::size_t block) const override { return std::min(block * kBlock, table_.size()); }
  void positions(std::size_t block, std::span<Position> out) const override {
    std::copy_n(table_.positions.begin() + std::ptrdiff_t(block_begin(block)), out.size(), out.begin());
  }
  ScalarType coordinate_type() const override { return table_.coordinate_type; }
  std::vector<Column> columns() const override { return {table_.columns.begin(), table_.columns.end()}; }
  void extract_block(std::size_t index, std::size_t block, std::span<char> out) const override {
    const TableColumn& column = table_.columns[index];
    std::copy_n(column.data.begin() + std::ptrdiff_t(block_begin(block) * column_bytes(column)), out.size(),
                out.begin());
  }
  void visit_faces(FaceVisitor& visitor) const override { visit(table_.faces, visitor); }
  Materials materials() const override { return materials_; }
  std::vector<Content> contents() const override { return contents_; }

 private:
  static constexpr std::size_t kBlock = 4096;

  Table table_;
  Materials materials_;
  std::vector<Content> contents_;
};

}  // namespace
}  // namespace gltf

std::shared_ptr<Source> read_gltf(FileBytes bytes, const std::string& name, const Reading&) {
  const gltf::Document document(std::move(bytes), name);
  try {
    gltf::Scene scene(document);
    Table table = scene.read();
    Materials materials;
    if (table.find("s")) materials = gltf::materials_of(document);
    return std::make_shared<gltf::GltfSource>(name, std::move(table), std::move(materials),
                                              gltf::further_contents(document.json(), scene.visited()));
  } catch (const gltf::Json::exception&) {
    fail(name, "this glTF file is damaged: its JSON is not that of glTF; export it again");
  } catch (const std::out_of_range& error) {
    fail(name,
         std::string("this glTF file is damaged, or has what is not known, in ") + error.what() + "; export it again");
  }
}

}  // namespace pointfair::io
