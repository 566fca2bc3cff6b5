// SPDX-License-Identifier: Apache-2.0
// What a shared libpointfair exports. The library is compiled with hidden visibility; these declarations are its ABI.
#pragma once

#if defined(__GNUC__)
#define POINTFAIR_EXPORT __attribute__((visibility("default")))
#define POINTFAIR_INTERNAL __attribute__((visibility("hidden")))
#else
#define POINTFAIR_EXPORT
#define POINTFAIR_INTERNAL
#endif
