# SPDX-License-Identifier: Apache-2.0
# cmake --install: the library, its headers, and what find_package(pointfair) reads.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/pointfair)
install(TARGETS pointfair EXPORT pointfairTargets)
install(DIRECTORY include/pointfair DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.hpp")
install(EXPORT pointfairTargets NAMESPACE pointfair:: DESTINATION ${package_dir})
configure_package_config_file(cmake/pointfairConfig.cmake.in pointfairConfig.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(pointfairConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/pointfairConfig.cmake ${PROJECT_BINARY_DIR}/pointfairConfigVersion.cmake
        DESTINATION ${package_dir})

# For pkg-config. Who links the static library links what it needs, also without --static.
set(pointfair_pc_requires tbb)
if(pugixml_FOUND)
  string(APPEND pointfair_pc_requires " pugixml")
endif()
if(BUILD_SHARED_LIBS)
  set(pointfair_pc_private ".private")
  set(pointfair_pc_libraries "-lpointfair")
else()
  set(pointfair_pc_private "")
  set(pointfair_pc_libraries "-lpointfair -pthread")
  if(TARGET pointfair_cuda)
    find_package(CUDAToolkit REQUIRED)
    get_target_property(cuda_runtime CUDA::cudart_static IMPORTED_LOCATION)
    string(APPEND pointfair_pc_libraries " ${cuda_runtime} -ldl -lrt")
  endif()
endif()
cmake_path(RELATIVE_PATH CMAKE_INSTALL_PREFIX BASE_DIRECTORY ${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_LIBDIR}/pkgconfig
           OUTPUT_VARIABLE pointfair_pc_prefix)
configure_file(cmake/pointfair.pc.in pointfair.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/pointfair.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
