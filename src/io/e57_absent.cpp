// SPDX-License-Identifier: Apache-2.0
// In place of the folder e57 in a build without pugixml.
#include "io/file_bytes.hpp"
#include "io/formats.hpp"

namespace pointfair::io {

std::shared_ptr<Source> read_e57(FileBytes, const std::string& name, const Reading&) {
  fail(name, "is an E57 file, and this build has no pugixml to read it with; install libpugixml-dev and build again");
}

std::vector<std::string> renamed_in_new_e57(const Cloud&) { return {}; }

void write_e57(Table, const Writing&, Output&) {
  throw Error(ErrorKind::usage, "this build has no pugixml, without which E57 files are neither read nor written");
}

}  // namespace pointfair::io
