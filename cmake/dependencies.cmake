# SPDX-License-Identifier: Apache-2.0
# What pointfair is built with. Each is looked for by find_package, and a build that finds them all never needs a network.
# With POINTFAIR_FETCH the sources of what is missing are fetched from their authors, in the version of Debian 12 that a hash
# names. FETCHCONTENT_SOURCE_DIR_<NAME IN CAPITALS> names a folder that has them already. nanobind, which comes with pip, and
# the benchmark's peers are found where they are used.
option(POINTFAIR_FETCH "Fetch the sources of dependencies that are not found; needs a network connection" OFF)
include(FetchContent)

# The package NAME with its target: found, or fetched. Headers only: INCLUDE is their folder, and TARGET is made of it.
# Otherwise the sources make the target, and are installed where what is installed is linked with them (LINKED).
#   pointfair_need(NAME DEBIAN package (URL url SHA256 hash | GIT url COMMIT id)
#                  [OPTIONAL] [LINKED] [FIND words of find_package] [INCLUDE folder TARGET name DEFINE macro] [SETTINGS NAME=value...])
# Sets NAME_FOUND; a package that is missing and not optional is named by pointfair_check_needs.
function(pointfair_need name)
  cmake_parse_arguments(PARSE_ARGV 1 need "OPTIONAL;LINKED" "DEBIAN;URL;SHA256;GIT;COMMIT;INCLUDE;TARGET;DEFINE" "FIND;SETTINGS")
  find_package(${name} ${need_FIND} QUIET)
  if(NOT ${name}_FOUND AND POINTFAIR_FETCH)
    pointfair_fetch()
    set(${name}_FOUND TRUE)
  elseif(NOT ${name}_FOUND AND NOT need_OPTIONAL)
    list(APPEND pointfair_missing "${name} (Debian: ${need_DEBIAN})")
    set(pointfair_missing "${pointfair_missing}" PARENT_SCOPE)
  endif()
  set(${name}_FOUND ${${name}_FOUND} PARENT_SCOPE)
endfunction()

# Of pointfair_need, with its words.
macro(pointfair_fetch)
  message(STATUS "${name} was not found; its sources are fetched")
  if(need_URL)
    set(place URL ${need_URL} URL_HASH SHA256=${need_SHA256})
  else()
    set(place GIT_REPOSITORY ${need_GIT} GIT_TAG ${need_COMMIT})
  endif()
  FetchContent_Declare(${name} ${place} SOURCE_SUBDIR none)  # only unpacked
  FetchContent_MakeAvailable(${name})
  string(TOLOWER ${name} lower)
  if(need_INCLUDE)
    add_library(pointfair_${lower} INTERFACE)
    target_include_directories(pointfair_${lower} SYSTEM INTERFACE ${${lower}_SOURCE_DIR}/${need_INCLUDE})
    target_compile_definitions(pointfair_${lower} INTERFACE ${need_DEFINE})
    add_library(${need_TARGET} ALIAS pointfair_${lower})
  else()
    set(CMAKE_POLICY_DEFAULT_CMP0077 NEW)  # options of theirs take the values below
    set(CMAKE_POLICY_VERSION_MINIMUM 3.5)  # older words than CMake 4 takes
    set(BUILD_SHARED_LIBS OFF)  # so that the program runs wherever it is installed
    set(CMAKE_POSITION_INDEPENDENT_CODE ON)
    set(CMAKE_CXX_FLAGS "${CMAKE_CXX_FLAGS} -w")
    foreach(setting IN LISTS need_SETTINGS)
      string(REGEX MATCH "^([^=]+)=(.*)$" _ "${setting}")
      set(${CMAKE_MATCH_1} ${CMAKE_MATCH_2})
    endforeach()
    set(exclude EXCLUDE_FROM_ALL)
    if(need_LINKED AND POINTFAIR_INSTALL)
      set(exclude "")
    endif()
    add_subdirectory(${${lower}_SOURCE_DIR} ${${lower}_BINARY_DIR} ${exclude} SYSTEM)
  endif()
endmacro()

function(pointfair_check_needs)
  if(pointfair_missing)
    list(JOIN pointfair_missing ", " missing)
    message(FATAL_ERROR "Not found: ${missing}. Install them (on Debian and Ubuntu: scripts/install_packages.sh build test), "
      "name the folder they are installed in with -DCMAKE_PREFIX_PATH=..., or configure with -DPOINTFAIR_FETCH=ON, which fetches their sources. "
      "Tests are left out with -DPOINTFAIR_TESTS=OFF, the viewer with -DPOINTFAIR_VIEWER=OFF.")
  endif()
endfunction()

find_package(Threads REQUIRED)
pointfair_need(TBB DEBIAN libtbb-dev LINKED
  URL https://github.com/uxlfoundation/oneTBB/archive/refs/tags/v2021.8.0.tar.gz
  SHA256 eee380323bb7ce864355ed9431f85c43955faaae9e9bce35c62b372d7ffd9f8b
  SETTINGS TBB_TEST=OFF TBB_STRICT=OFF TBB_EXAMPLES=OFF TBBMALLOC_BUILD=OFF TBB_ENABLE_IPO=OFF TBB_DISABLE_HWLOC_AUTOMATIC_SEARCH=ON)
pointfair_need(FastFloat DEBIAN libfast-float-dev
  URL https://github.com/fastfloat/fast_float/archive/refs/tags/v3.9.0.tar.gz
  SHA256 a10443e13748291709b422b2da49fc6753a1a43bf24205d4600595dfe3d811bb
  INCLUDE include TARGET FastFloat::fast_float)
pointfair_need(pugixml DEBIAN libpugixml-dev LINKED OPTIONAL
  URL https://github.com/zeux/pugixml/archive/refs/tags/v1.13.tar.gz
  SHA256 5c5ad5d7caeb791420408042a7d88c2c6180781bf218feca259fd9d840a888e1)
if(NOT pugixml_FOUND)
  message(STATUS "pugixml was not found, so E57 files will not be read; Debian has it in libpugixml-dev")
endif()
if(NOT POINTFAIR_TOOLS)  # the library alone does without glTF
  set(optional OPTIONAL)
endif()
pointfair_need(nlohmann_json DEBIAN nlohmann-json3-dev ${optional}
  URL https://github.com/nlohmann/json/archive/refs/tags/v3.11.2.tar.gz
  SHA256 d69f9deb6a75e2580465c6c4c5111b89c4dc2fa94e3a85fcd2ffcd9a143d9273
  INCLUDE include TARGET nlohmann_json::nlohmann_json)
if(POINTFAIR_TOOLS OR POINTFAIR_BENCH)
  pointfair_need(CLI11 DEBIAN libcli11-dev
    URL https://github.com/CLIUtils/CLI11/archive/refs/tags/v2.1.2.tar.gz
    SHA256 26291377e892ba0e5b4972cdfd4a2ab3bf53af8dac1f4ea8fe0d1376b625c8cb
    INCLUDE include TARGET CLI11::CLI11)
endif()
if(POINTFAIR_TOOLS)
  pointfair_need(fmt DEBIAN libfmt-dev
    URL https://github.com/fmtlib/fmt/archive/refs/tags/9.1.0.tar.gz
    SHA256 5dea48d1fcddc3ec571ce2058e13910a0d4a6bab4cc09a809d8b1dd1c88ae6f2
    INCLUDE include TARGET fmt::fmt DEFINE FMT_HEADER_ONLY)
endif()
if(POINTFAIR_TOOLS OR POINTFAIR_TESTS)
  pointfair_need(nanoflann DEBIAN libnanoflann-dev
    URL https://github.com/jlblancoc/nanoflann/archive/refs/tags/v1.4.3.tar.gz
    SHA256 cbcecf22bec528a8673a113ee9b0e134f91f1f96be57e913fa1f74e98e4449fa
    INCLUDE include TARGET nanoflann::nanoflann)
endif()
if(POINTFAIR_TOOLS AND POINTFAIR_VIEWER)  # 110 MB to fetch
  pointfair_need(Boost DEBIAN libboost-dev FIND 1.74 CONFIG  # not CMake's own module, which newer versions warn of
    URL https://archives.boost.io/release/1.74.0/source/boost_1_74_0.tar.bz2
    SHA256 83bfc1507731a0906e387fc28b7ef5417d591429e51e788417fe9ff025e116b1
    INCLUDE . TARGET Boost::headers)
endif()
if(POINTFAIR_TESTS)
  pointfair_need(Eigen3 DEBIAN libeigen3-dev FIND NO_MODULE
    URL https://gitlab.com/libeigen/eigen/-/archive/3.4.0/eigen-3.4.0.tar.gz
    SHA256 8586084f71f9bde545ee7fa6d00288b264a2b7ac3607b974e54d13e7162c1c72
    INCLUDE . TARGET Eigen3::Eigen)
  pointfair_need(GTest DEBIAN libgtest-dev
    URL https://github.com/google/googletest/archive/refs/tags/release-1.12.1.tar.gz
    SHA256 81964fe578e9bd7c94dfdb09c8e4d6e6759e19967e397dbea48d1c10e45d0df2
    SETTINGS BUILD_GMOCK=OFF INSTALL_GTEST=OFF)
  pointfair_need(rapidcheck DEBIAN librapidcheck-dev  # which has no releases; the commit is a hash
    GIT https://github.com/emil-e/rapidcheck.git COMMIT 08b505857e32d52a20b2240b5125d937d67a6d86)
endif()
pointfair_check_needs()
