// SPDX-License-Identifier: Apache-2.0
// A PCD file without some of its points: all that is left keeps its bytes, in no grid.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace pointfair::io {

/// Of these, `removed` is not 0 for those that go.
std::uint64_t count_left(std::span<const std::uint8_t> removed);

/// Takes records of `size` bytes out of `data`, which holds one for each of `removed` from `begin` on, and ends there.
void take_out_records(std::span<const std::uint8_t> removed, std::size_t size, std::size_t begin, std::string& data);

/// The same of lines, among which comments stay.
void take_out_lines(std::span<const std::uint8_t> removed, char line_end, std::size_t begin, std::string& text);

/// A header whose file has this number of points, in one row.
std::string pcd_header_of(std::string header, char line_end, std::uint64_t points);

}  // namespace pointfair::io
