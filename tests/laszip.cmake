# SPDX-License-Identifier: Apache-2.0
# LASzip, with which the tests compare LAZ files, as an object library: from the archive that scripts/fetch_laszip.sh
# fetches. Without it these tests are left out.
set(laszip_archive_name laszip-0.3.0.tar.gz)
set(laszip_folder laszip-0.3.0/src/vendor/LASzip-4f39c23907bb92cc583aa95bb2ace2ca4f6efdbe)
set(POINTFAIR_LASZIP_ARCHIVE "${PROJECT_SOURCE_DIR}/build/downloads/${laszip_archive_name}" CACHE FILEPATH
    "LASzip's source archive, for the tests")
if(NOT EXISTS ${POINTFAIR_LASZIP_ARCHIVE})
  message(STATUS "Tests that compare LAZ files with LASzip are left out: run scripts/fetch_laszip.sh and configure again")
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
add_library(laszip_oracle OBJECT ${laszip_files})
# NDEBUG: its assertions abort on damaged files, which it notices without them. Its arithmetic relies on wrapping.
target_compile_definitions(laszip_oracle PRIVATE NDEBUG UNORDERED)
target_compile_options(laszip_oracle PRIVATE -w -fwrapv -O3 -fno-sanitize=undefined)
target_include_directories(laszip_oracle SYSTEM PUBLIC ${laszip_sources} ${laszip_sources}/../include/laszip)
set_target_properties(laszip_oracle PROPERTIES CXX_STANDARD 17)
