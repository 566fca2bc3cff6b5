// SPDX-License-Identifier: Apache-2.0
// Attributes that the standard has no name for are fields of an extension, and so have a prefix in the file.
#pragma once

namespace pointfair::io::e57 {

inline constexpr const char* kOwnPrefix = "pf:";
inline constexpr const char* kOwnUri = "urn:pointfair:attributes";

}  // namespace pointfair::io::e57
