# SPDX-License-Identifier: Apache-2.0
# Toolchain file: zig's clang as a compiler for any system, with its own libc++, which is linked statically.
#   -DPOINTFAIR_ZIG=FILE              the program zig
#   -DPOINTFAIR_ZIG_TARGET=TRIPLE     in zig's words: x86_64-linux-gnu.2.28 is Linux with glibc 2.28 and later;
#                                     wasm32-wasi is WebAssembly, for which CMAKE_PREFIX_PATH must have cmake/wasm
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES POINTFAIR_ZIG POINTFAIR_ZIG_TARGET)
string(REGEX MATCH "^([^-]+)-([^-.]+)" _ "${POINTFAIR_ZIG_TARGET}")
set(CMAKE_SYSTEM_PROCESSOR ${CMAKE_MATCH_1})
if(CMAKE_MATCH_2 STREQUAL "macos")
  set(CMAKE_SYSTEM_NAME Darwin)
elseif(CMAKE_MATCH_2 STREQUAL "windows")
  set(CMAKE_SYSTEM_NAME Windows)
elseif(CMAKE_MATCH_2 STREQUAL "wasi")
  set(CMAKE_SYSTEM_NAME Generic)
else()
  set(CMAKE_SYSTEM_NAME Linux)
endif()

# CMake wants a program for each tool; zig has them as verbs.
set(pointfair_tools ${CMAKE_BINARY_DIR}/zig)
if(NOT EXISTS ${pointfair_tools}/ranlib)
  foreach(verb c++ cc ar ranlib)
    file(WRITE ${pointfair_tools}/${verb} "#!/bin/sh\nexec '${POINTFAIR_ZIG}' ${verb} \"$@\"\n")
    file(CHMOD ${pointfair_tools}/${verb} PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE)
  endforeach()
endif()
# zig's compiler of resources, called as windres is: all that is asked of it is FILE.rc into an object, the last two words.
if(CMAKE_SYSTEM_NAME STREQUAL "Windows" AND NOT EXISTS ${pointfair_tools}/windres)
  file(WRITE ${pointfair_tools}/windres "#!/bin/sh\n\
while [ $# -gt 2 ]; do shift; done\nexec '${POINTFAIR_ZIG}' rc /:output-format coff -- \"$1\" \"$2\"\n")
  file(CHMOD ${pointfair_tools}/windres PERMISSIONS OWNER_READ OWNER_WRITE OWNER_EXECUTE)
endif()
if(CMAKE_SYSTEM_NAME STREQUAL "Windows")
  set(CMAKE_RC_COMPILER ${pointfair_tools}/windres)
endif()
foreach(language C CXX)
  set(CMAKE_${language}_COMPILER_TARGET ${POINTFAIR_ZIG_TARGET})
  set(CMAKE_${language}_COMPILER_AR ${pointfair_tools}/ar)
  set(CMAKE_${language}_COMPILER_RANLIB ${pointfair_tools}/ranlib)
endforeach()
set(CMAKE_C_COMPILER ${pointfair_tools}/cc)
set(CMAKE_CXX_COMPILER ${pointfair_tools}/c++)
set(CMAKE_AR ${pointfair_tools}/ar)
set(CMAKE_RANLIB ${pointfair_tools}/ranlib)

# Without notes for debuggers, which zig adds unasked; stripped as they are linked, for lack of a strip for other systems.
# zig makes -O2 of every -O above it, and keeps frame pointers, which macOS asks for.
foreach(language C CXX)
  set(CMAKE_${language}_FLAGS_INIT "-g0")
  if(NOT CMAKE_SYSTEM_NAME STREQUAL "Darwin")
    string(APPEND CMAKE_${language}_FLAGS_INIT " -fomit-frame-pointer")
  endif()
  set(CMAKE_${language}_FLAGS_RELEASE_INIT "-Xclang -O3")
endforeach()
foreach(kind EXE SHARED MODULE)
  set(CMAKE_${kind}_LINKER_FLAGS_RELEASE_INIT "-s")
  if(CMAKE_SYSTEM_NAME STREQUAL "Darwin")
    string(APPEND CMAKE_${kind}_LINKER_FLAGS_RELEASE_INIT " -Wl,-x")  # the names of what is not exported, which -s keeps there
  endif()
endforeach()

# Nothing of this machine but programs, Python and what CMAKE_PREFIX_PATH names.
set(CMAKE_FIND_USE_CMAKE_SYSTEM_PATH OFF)
set(CMAKE_FIND_USE_SYSTEM_PACKAGE_REGISTRY OFF)

# Exceptions of WebAssembly, for which zig's own libc++ is not built; the calls of threads are there and fail.
if(POINTFAIR_ZIG_TARGET STREQUAL "wasm32-wasi")
  set(pointfair_features "-mcpu=generic+exception_handling+simd128+bulk_memory+nontrapping_fptoint+sign_ext -fwasm-exceptions \
-D_WASI_EMULATED_SIGNAL -D_WASI_EMULATED_MMAN -D_WASI_EMULATED_PROCESS_CLOCKS -D_WASI_EMULATED_GETPID -fno-sanitize=undefined")
  set(CMAKE_C_FLAGS_INIT "-g0 ${pointfair_features}")
  unset(CMAKE_C_FLAGS_RELEASE_INIT)
  unset(CMAKE_CXX_FLAGS_RELEASE_INIT)
  set(CMAKE_ASM_FLAGS_INIT "--target=wasm32-wasi -mcpu=generic+exception_handling")
  set(CMAKE_ASM_COMPILER ${pointfair_tools}/cc)
  set(CMAKE_CXX_FLAGS_INIT "-g0 ${pointfair_features} -U_LIBCPP_HAS_THREADS -D_LIBCPP_HAS_THREADS=1 \
-U_LIBCPP_HAS_FILESYSTEM -D_LIBCPP_HAS_FILESYSTEM=1 -D_LIBCPP_HAS_TIME_ZONE_DATABASE=0")
  set(CMAKE_TRY_COMPILE_TARGET_TYPE STATIC_LIBRARY)
  set(CMAKE_EXECUTABLE_SUFFIX_CXX .wasm)
  # by the compiler of C, which brings no libc++ along
  set(CMAKE_CXX_LINK_EXECUTABLE "${pointfair_tools}/cc --target=wasm32-wasi -O2 -s -Wl,--gc-sections -Wl,-z,stack-size=4194304 \
<LINK_FLAGS> <OBJECTS> -o <TARGET> <LINK_LIBRARIES> -L${CMAKE_PREFIX_PATH}/lib -lpointfair_wasm -lwasi-emulated-signal -lwasi-emulated-mman \
-lwasi-emulated-process-clocks -lwasi-emulated-getpid")
  set(CMAKE_HAVE_LIBC_PTHREAD TRUE)
endif()
