# SPDX-License-Identifier: Apache-2.0
# Headers of this machine as packages of a prefix, without the rest of its /usr/include.

# The package NAME with the target NAME::TARGET over headers of this machine, to which the prefix has links.
function(add_headers name target header)
  add_library(${target} INTERFACE)
  target_include_directories(${target} INTERFACE $<INSTALL_INTERFACE:include>)
  install(TARGETS ${target} EXPORT ${name})
  install(EXPORT ${name} NAMESPACE ${name}:: FILE ${name}Config.cmake DESTINATION lib/cmake/${name})
  set(headers ${headers} ${header} PARENT_SCOPE)
endfunction()
add_headers(CLI11 CLI11 CLI)
add_headers(FastFloat fast_float fast_float)
add_headers(fmt fmt fmt)
add_headers(nlohmann_json nlohmann_json nlohmann)
add_headers(nanoflann nanoflann nanoflann.hpp)
add_headers(Boost headers boost)
target_compile_definitions(fmt INTERFACE FMT_HEADER_ONLY)
foreach(header IN LISTS headers)
  find_path(folder_of_${header} ${header} PATHS /usr/include /usr/local/include REQUIRED NO_DEFAULT_PATH)
  install(CODE "file(MAKE_DIRECTORY \${CMAKE_INSTALL_PREFIX}/include)
    file(CREATE_LINK ${folder_of_${header}}/${header} \${CMAKE_INSTALL_PREFIX}/include/${header} SYMBOLIC)")
endforeach()

# of Boost a version is asked for
file(STRINGS ${folder_of_boost}/boost/version.hpp boost_version REGEX "define BOOST_LIB_VERSION ")
string(REGEX REPLACE ".*\"(.*)\".*" "\\1" boost_version "${boost_version}")
string(REPLACE "_" "." boost_version ${boost_version})
include(CMakePackageConfigHelpers)
write_basic_package_version_file(${CMAKE_CURRENT_BINARY_DIR}/BoostConfigVersion.cmake VERSION ${boost_version}
  COMPATIBILITY AnyNewerVersion ARCH_INDEPENDENT)
install(FILES ${CMAKE_CURRENT_BINARY_DIR}/BoostConfigVersion.cmake DESTINATION lib/cmake/Boost)
