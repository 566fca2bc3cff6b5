// SPDX-License-Identifier: Apache-2.0
// In place of the folder gltf in a build without nlohmann-json.
#include "io/file_bytes.hpp"
#include "io/formats.hpp"

namespace pointfair::io {

std::shared_ptr<Source> read_gltf(FileBytes, const std::string& name, const Reading&) {
  fail(name,
       "is a glTF file, and this build has no nlohmann-json to read it with; install nlohmann-json3-dev and build "
       "again");
}

}  // namespace pointfair::io
