// SPDX-License-Identifier: Apache-2.0
// Files whose points are not held in memory: read block by block, and written block by block.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "io/source.hpp"

namespace pointfair::io {

/// Whether a path can be read once only: "-", a pipe, a device.
bool is_stream(const std::filesystem::path& path);

/// Opens a file to be read block by block (Source::place_block). The origin is yet to be set. Throws Error(file), also
/// for a file that can only be decoded as a whole.
std::shared_ptr<Source> open_source(const std::filesystem::path& path, unsigned threads);

/// Why write_moved() would refuse these options for this source, or an attribute of this name that is added, none if it
/// is empty; empty if it would not. Throws as write() does for options that contradict each other.
std::string why_not_streamed(const Source& source, const std::filesystem::path& path, const WriteOptions& options,
                             const std::string& added);

/// What write_moved() with these options does not keep, a sentence each.
std::vector<std::string> losses_when_streamed(const Source& source, const std::filesystem::path& path,
                                              const WriteOptions& options, const std::string& added);

/// Throws Error(file) as WriteOptions::strict asks for, unless nothing is lost.
void refuse_losses(const std::filesystem::path& path, const std::vector<std::string>& lost);

/// As write() of a cloud of this source whose points are where `moved` says, relative to the source's origin, with the
/// attributes that are added, and without the points of which `removed` is not 0; empty: with all. Does not look at
/// WriteOptions::strict.
void write_moved(const std::filesystem::path& path, const std::shared_ptr<Source>& source, const MovedPoints& moved,
                 const WriteOptions& options, std::vector<Attribute> added, std::span<const std::uint8_t> removed = {});

}  // namespace pointfair::io
