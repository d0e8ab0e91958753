# What `cmake --install` puts where: headers, static libraries, the package antipode for find_package, the program
# and the models. Consumers link antipode::antipode, or single layers such as antipode::geometry.
include(CMakePackageConfigHelpers)

get_property(libraries GLOBAL PROPERTY ANTIPODE_LIBRARIES)
add_library(antipode_umbrella INTERFACE)
set_target_properties(antipode_umbrella PROPERTIES EXPORT_NAME antipode)
target_link_libraries(antipode_umbrella INTERFACE ${libraries})

install(TARGETS ${libraries} antipode_umbrella EXPORT antipodeTargets ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/src/antipode DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}
  FILES_MATCHING PATTERN "*.h")
install(DIRECTORY ${PROJECT_SOURCE_DIR}/models/ DESTINATION ${CMAKE_INSTALL_DATADIR}/antipode/models)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})
if(TARGET antipode)
  # Spelt out because CMAKE_INSTALL_RPATH_USE_LINK_PATH leaves out folders below the source tree, such as .venv.
  set_target_properties(antipode PROPERTIES INSTALL_RPATH "${LibTorch_LIBRARY_DIR}")
  install(TARGETS antipode RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()

set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/antipode)
if(ANTIPODE_NEURAL)
  get_filename_component(torch_dir ${LibTorch_LIBRARY_DIR} DIRECTORY)
endif()
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/antipodeConfig.cmake.in
  ${PROJECT_BINARY_DIR}/antipodeConfig.cmake INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/antipodeConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(EXPORT antipodeTargets NAMESPACE antipode:: DESTINATION ${package_dir})
install(FILES
  ${PROJECT_BINARY_DIR}/antipodeConfig.cmake ${PROJECT_BINARY_DIR}/antipodeConfigVersion.cmake
  ${PROJECT_SOURCE_DIR}/cmake/FindEmbree.cmake ${PROJECT_SOURCE_DIR}/cmake/FindLibTorch.cmake
  ${PROJECT_SOURCE_DIR}/cmake/FindLibZip.cmake
  DESTINATION ${package_dir})
