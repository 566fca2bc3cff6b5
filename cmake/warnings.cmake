# SPDX-License-Identifier: Apache-2.0
# What every target of this project is compiled with. No contraction into fused multiply-adds: results must not depend
# on the instruction set.
add_library(pointfair_options INTERFACE)
target_compile_options(pointfair_options INTERFACE
  $<$<COMPILE_LANGUAGE:CXX>:-Wall;-Wextra;-Wshadow;-Wconversion;-Wno-sign-conversion;-Wno-psabi;-ffp-contract=off>
  $<$<AND:$<COMPILE_LANGUAGE:CXX>,$<BOOL:${POINTFAIR_WARNINGS_AS_ERRORS}>>:-Werror>)
# the header of Windows: without the macros min and max, and without what is seldom used
target_compile_definitions(pointfair_options INTERFACE $<$<BOOL:${WIN32}>:NOMINMAX;WIN32_LEAN_AND_MEAN>)
