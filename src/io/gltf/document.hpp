// SPDX-License-Identifier: Apache-2.0
// A glTF 2.0 file: its JSON, and the numbers that its accessors name in its buffers.
#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/file_bytes.hpp"
#include "io/scalar.hpp"

namespace pointfair::io::gltf {

using Json = nlohmann::json;

/// Values of an accessor: `count` elements of `components` numbers each.
struct Values {
  std::string_view bytes;  ///< from the first element on
  std::size_t count = 0, components = 0, stride = 0;
  NativeType type = NativeType::float32;
  bool normalized = false;

  /// An integer that is normalized is a share of its greatest value.
  double at(std::size_t element, std::size_t component) const;
};

class Document {
 public:
  /// Throws Error(file) for what is no glTF file, or needs what is not known here.
  Document(FileBytes bytes, std::string name);

  const Json& json() const { return json_; }
  const std::string& name() const { return name_; }
  std::size_t file_size() const { return file_size_; }  ///< with all buffers

  /// The element of an array of the document. Throws Error(file) if there is none.
  const Json& element(const char* array, const Json& index) const;
  Values values(const Json& accessor_index) const;
  /// The image at an index: its bytes where a buffer or a data URI has them, else null; and what it is called.
  std::pair<std::string, std::shared_ptr<const std::string>> image(const Json& index) const;

 private:
  void read_container(std::string_view bytes);
  void read_buffers();
  std::string data_of(std::string_view uri, const std::string& what) const;
  std::string_view view_bytes(const Json& view) const;
  [[noreturn]] void damaged(const std::string& what) const;

  FileBytes bytes_;
  std::string name_;
  Json json_;
  std::string_view binary_;       ///< the chunk of a GLB file
  std::vector<FileBytes> files_;  ///< other files that hold buffers
  std::vector<std::string_view> buffers_;
  std::size_t file_size_ = 0;
};

}  // namespace pointfair::io::gltf
