// SPDX-License-Identifier: Apache-2.0
// Where a file is written to: a temporary file that gets its name at the end, a stream, or memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace pointfair::io {

class Output {
 public:
  Output() = default;
  virtual ~Output() = default;
  Output(const Output&) = delete;
  Output& operator=(const Output&) = delete;
  virtual void write(std::string_view bytes) = 0;
  /// Whether `patch` can be called: not where bytes leave as they are written.
  virtual bool can_patch() const { return true; }
  /// Replaces bytes that were written before, from `at` on.
  virtual void patch(std::uint64_t at, std::string_view bytes) = 0;
  /// Throws Error(file), with the bytes needed, if there was no room for all that was written.
  virtual void require_room() {}
  /// Everything was written: the file may appear under its name. Not called: it never appears.
  virtual void finish() = 0;
};

/// Collects the bytes in `bytes`.
class MemoryOutput : public Output {
 public:
  void write(std::string_view more) override { bytes += more; }
  void patch(std::uint64_t at, std::string_view other) override {
    bytes.replace(static_cast<std::size_t>(at), other.size(), other);
  }
  void finish() override {}

  std::string bytes;
};

/// Calls `write(to)` with an output that can be patched: `out`, or memory whose bytes then go there.
template <class Write>
void write_patched(Output& out, const Write& write) {
  if (out.can_patch()) return write(out);
  MemoryOutput memory;
  write(static_cast<Output&>(memory));
  out.write(memory.bytes);
}

/// Opens `path`; "-" is standard output, and a device or pipe is written directly. Anything else is written to a
/// temporary file in the same directory and renamed by `finish`. Throws Error(file), also if the file exists and
/// `overwrite` is false. `sync`: the data is on the disk before the file gets its name.
std::unique_ptr<Output> open_output(const std::filesystem::path& path, bool overwrite, bool sync);

}  // namespace pointfair::io
