# SPDX-License-Identifier: Apache-2.0
vcpkg_check_linkage(ONLY_STATIC_LIBRARY)
vcpkg_download_distfile(archive
  URLS "@URL@"
  FILENAME "pointfair-@VERSION@.tar.gz"
  SHA512 @SHA512@)
vcpkg_extract_source_archive(source ARCHIVE "${archive}")
vcpkg_check_features(OUT_FEATURE_OPTIONS features FEATURES tools POINTFAIR_TOOLS)
vcpkg_cmake_configure(
  SOURCE_PATH "${source}"
  OPTIONS ${features} -DPOINTFAIR_CUDA=OFF -DPOINTFAIR_TESTS=OFF -DPOINTFAIR_VIEWER=OFF)
vcpkg_cmake_install()
vcpkg_cmake_config_fixup(CONFIG_PATH lib/cmake/pointfair)
vcpkg_fixup_pkgconfig()
if("tools" IN_LIST FEATURES)
  vcpkg_copy_tools(TOOL_NAMES pointfair AUTO_CLEAN)
  vcpkg_execute_required_process(
    COMMAND "${source}/packaging/smoke.sh" "${CURRENT_PACKAGES_DIR}/tools/pointfair/pointfair"
    WORKING_DIRECTORY "${source}" LOGNAME "smoke-${TARGET_TRIPLET}")
endif()
file(REMOVE_RECURSE "${CURRENT_PACKAGES_DIR}/debug/include" "${CURRENT_PACKAGES_DIR}/debug/share")
file(INSTALL "${CMAKE_CURRENT_LIST_DIR}/usage" DESTINATION "${CURRENT_PACKAGES_DIR}/share/${PORT}")
vcpkg_install_copyright(FILE_LIST "${source}/LICENSE")
