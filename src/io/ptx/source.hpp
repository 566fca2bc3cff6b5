// SPDX-License-Identifier: Apache-2.0
// A PTX file behind a cloud: the points of all its scans, one scan after the other, in the coordinates that they share.
#pragma once

#include <string>
#include <vector>

#include "io/ptx/scans.hpp"
#include "io/text_source.hpp"

namespace pointfair::io::ptx {

class PtxSource final : public TextSource {
 public:
  PtxSource(FileBytes bytes, const std::string& name, Layout layout);

  void positions(std::size_t block, std::span<Position> out) const override;
  std::vector<Column> columns() const override;
  void extract_block(std::size_t index, std::size_t block, std::span<char> out) const override;
  std::string why_fixed(std::size_t column) const override;
  std::optional<Position> sensor(std::size_t block) const override;
  FileInfo info() const override;
  std::vector<Content> contents() const override;

 protected:
  std::vector<TextColumn> attributes_of(std::size_t block) const override;
  float offset_of(std::size_t block, const Position& position, std::size_t axis) const override;
  void append_block(std::size_t block, const Moves& moves, const Edits& edits, std::string& to) const override;

 private:
  const Scan& scan_of(std::size_t block) const { return scans_[scan_of_block_[block]]; }

  std::vector<Scan> scans_;
  std::vector<std::size_t> scan_of_block_;
};

}  // namespace pointfair::io::ptx
