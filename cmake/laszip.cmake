# SPDX-License-Identifier: Apache-2.0
# LASzip, the codec of LAZ files, as an object library that becomes part of pointfair: the sources of the archive that
# laszip.requirements.txt names by version and hash, fetched with pip once and kept beside the build directories.
# Without network and archive the build goes on without it, and says so: POINTFAIR_LAS is then OFF.
set(laszip_archive_name laszip-0.3.0.tar.gz)
set(laszip_requirements ${CMAKE_CURRENT_LIST_DIR}/laszip.requirements.txt)
set(laszip_folder laszip-0.3.0/src/vendor/LASzip-4f39c23907bb92cc583aa95bb2ace2ca4f6efdbe)
set(POINTFAIR_LASZIP_ARCHIVE "${PROJECT_SOURCE_DIR}/build/downloads/${laszip_archive_name}" CACHE FILEPATH
    "LASzip's source archive; fetched with pip if it is not there")

# Sets `problem` in the caller if the archive is not there and cannot be fetched, or is another file.
function(pointfair_fetch_laszip problem)
  set(${problem} "" PARENT_SCOPE)
  if(NOT EXISTS ${POINTFAIR_LASZIP_ARCHIVE})
    find_program(POINTFAIR_PYTHON3 python3)
    cmake_path(GET POINTFAIR_LASZIP_ARCHIVE PARENT_PATH folder)
    if(NOT POINTFAIR_PYTHON3)
      set(${problem} "python3 was not found, which fetches it" PARENT_SCOPE)
      return()
    endif()
    message(STATUS "Fetching LASzip's sources with pip")
    execute_process(COMMAND ${POINTFAIR_PYTHON3} -m pip download --quiet --disable-pip-version-check --no-deps
                    --no-binary laszip --require-hashes --requirement ${laszip_requirements} --dest ${folder}
                    RESULT_VARIABLE failed ERROR_VARIABLE output OUTPUT_QUIET TIMEOUT 300)
    if(failed)
      string(STRIP "${output}" output)
      set(${problem} "`pip download` failed, which needs python3-pip and a network connection:\n${output}" PARENT_SCOPE)
      return()
    endif()
  endif()
  file(STRINGS ${laszip_requirements} requirement REGEX sha256)
  string(REGEX REPLACE ".*sha256:" "" expected "${requirement}")
  file(SHA256 ${POINTFAIR_LASZIP_ARCHIVE} found)
  if(NOT found STREQUAL expected)
    set(${problem} "${POINTFAIR_LASZIP_ARCHIVE} is not the archive it should be: remove it and configure again" PARENT_SCOPE)
  endif()
endfunction()

pointfair_fetch_laszip(laszip_problem)
if(laszip_problem)
  message(WARNING "LASzip is not here: ${laszip_problem}\n"
    "LAZ files of point formats 4 and 5 will not be read, attributes of formats 6 to 10 neither, and no new LAZ files "
    "written. All else works. To build with it, connect this machine or name its archive, ${laszip_archive_name}, in "
    "-DPOINTFAIR_LASZIP_ARCHIVE=FILE; to build without it and this message, set -DPOINTFAIR_LAS=OFF.")
  set(POINTFAIR_LAS OFF)
  return()
endif()

set(laszip_sources ${PROJECT_BINARY_DIR}/${laszip_folder}/src)
if(NOT EXISTS ${laszip_sources}/laszip.hpp)
  file(ARCHIVE_EXTRACT INPUT ${POINTFAIR_LASZIP_ARCHIVE} DESTINATION ${PROJECT_BINARY_DIR} PATTERNS ${laszip_folder}/src ${laszip_folder}/include)
endif()
set(laszip_files mydefs lasmessage arithmeticdecoder arithmeticencoder arithmeticmodel integercompressor
  lasreaditemcompressed_v1 lasreaditemcompressed_v2 lasreaditemcompressed_v3 lasreaditemcompressed_v4 lasreadpoint
  laswriteitemcompressed_v1 laswriteitemcompressed_v2 laswriteitemcompressed_v3 laswriteitemcompressed_v4 laswritepoint
  laszip)
list(TRANSFORM laszip_files REPLACE "(.+)" "${laszip_sources}/\\1.cpp")
add_library(pointfair_laszip OBJECT ${laszip_files})
# NDEBUG: its assertions abort on damaged files, which it notices without them. Its arithmetic relies on wrapping.
target_compile_definitions(pointfair_laszip PRIVATE NDEBUG UNORDERED)
target_compile_options(pointfair_laszip PRIVATE -w -fwrapv -O3 -fno-sanitize=undefined)
target_include_directories(pointfair_laszip SYSTEM PUBLIC ${laszip_sources} ${laszip_sources}/../include/laszip)
set_target_properties(pointfair_laszip PROPERTIES POSITION_INDEPENDENT_CODE ON CXX_VISIBILITY_PRESET hidden
  VISIBILITY_INLINES_HIDDEN ON CXX_STANDARD 17)
