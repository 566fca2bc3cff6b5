// SPDX-License-Identifier: Apache-2.0
#include "platform/large_pages.hpp"

namespace pointfair::platform {

// They need a right that users do not have.
void prefer_large_pages(void*, std::size_t) {}

}  // namespace pointfair::platform
