# SPDX-License-Identifier: Apache-2.0
# Toolchain file: g++ of this machine, and zig to link what it compiled: with the stubs of an older glibc, and with libstdc++
# and an unwinder inside. For the CUDA backend, whose compiler takes no libc++ and so none of zig's C++.
#   -DPOINTFAIR_ZIG=FILE              the program zig
#   -DPOINTFAIR_ZIG_TARGET=TRIPLE     in zig's words: x86_64-linux-gnu.2.28 is glibc 2.28 and later
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES POINTFAIR_ZIG POINTFAIR_ZIG_TARGET)
set(CMAKE_C_COMPILER gcc)
set(CMAKE_CXX_COMPILER g++)
set(CMAKE_CUDA_HOST_COMPILER g++)

foreach(name IN ITEMS libstdc++.a libgcc.a)
  execute_process(COMMAND g++ -print-file-name=${name} OUTPUT_VARIABLE file OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
  list(APPEND pointfair_static ${file})
endforeach()
list(JOIN pointfair_static " " pointfair_static)
# zig's unwinder in place of libgcc_eh.a, which asks for glibc 2.35
set(pointfair_link "'${POINTFAIR_ZIG}' cc -target ${POINTFAIR_ZIG_TARGET} -g0 -s")
set(pointfair_libraries "${CMAKE_CURRENT_LIST_DIR}/older_glibc.c ${pointfair_static} -lunwind -lm")
foreach(language IN ITEMS C CXX)
  set(CMAKE_${language}_LINK_EXECUTABLE
      "${pointfair_link} <LINK_FLAGS> <OBJECTS> -o <TARGET> <LINK_LIBRARIES> ${pointfair_libraries}")
  foreach(kind IN ITEMS LIBRARY MODULE)
    set(CMAKE_${language}_CREATE_SHARED_${kind}
        "${pointfair_link} -shared <LINK_FLAGS> <SONAME_FLAG><TARGET_SONAME> <OBJECTS> -o <TARGET> <LINK_LIBRARIES> ${pointfair_libraries}")
  endforeach()
endforeach()

# Nothing of this machine but programs, Python and what CMAKE_PREFIX_PATH names.
set(CMAKE_FIND_USE_CMAKE_SYSTEM_PATH OFF)
set(CMAKE_FIND_USE_SYSTEM_PACKAGE_REGISTRY OFF)
