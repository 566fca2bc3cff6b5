// SPDX-License-Identifier: Apache-2.0
// What CPython's headers of the stable interface ask of its configuration, for Windows with 64 bits: scripts/wheels
// puts this file in the place of another system's. All other headers are the same everywhere.
#pragma once

#define MS_WINDOWS 1
#define MS_WIN64 1
#define Py_ENABLE_SHARED 1  // its variables are those of a DLL
#define HAVE_DECLSPEC_DLL 1
#define WITH_THREAD 1

#define ALIGNOF_MAX_ALIGN_T 8
#define SIZEOF_INT 4
#define SIZEOF_LONG 4
#define SIZEOF_LONG_LONG 8
#define SIZEOF_PID_T 4
#define SIZEOF_SIZE_T 8
#define SIZEOF_VOID_P 8
#define SIZEOF_WCHAR_T 2
