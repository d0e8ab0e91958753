# antipode_library(NAME DEPENDS lib...): one folder is one library. Every *.cc beside the list file belongs to it;
# every *_test.cc becomes part of the test program NAME_test.
function(antipode_library name)
  cmake_parse_arguments(ARG "" "" "DEPENDS;PRIVATE;TEST_DEPENDS" ${ARGN})
  file(GLOB sources CONFIGURE_DEPENDS *.cc)
  set(tests ${sources})
  list(FILTER tests INCLUDE REGEX "_test\\.cc$")
  list(FILTER sources EXCLUDE REGEX "(_test|main|_main)\\.cc$")

  set(target antipode_${name})
  if(NOT sources)
    add_library(${target} INTERFACE)
    add_library(antipode::${name} ALIAS ${target})
    set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
    target_include_directories(${target} INTERFACE
      $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
    target_link_libraries(${target} INTERFACE ${ARG_DEPENDS})
    set_property(GLOBAL APPEND PROPERTY ANTIPODE_LIBRARIES ${target})
    return()
  endif()
  add_library(${target} STATIC ${sources})
  add_library(antipode::${name} ALIAS ${target})
  set_target_properties(${target} PROPERTIES EXPORT_NAME ${name})
  target_include_directories(${target} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_link_libraries(${target} PUBLIC ${ARG_DEPENDS} PRIVATE ${ARG_PRIVATE})
  antipode_compile_options(${target})
  set_property(GLOBAL APPEND PROPERTY ANTIPODE_LIBRARIES ${target})

  if(ANTIPODE_TESTS AND tests)
    add_executable(${name}_test ${tests})
    target_link_libraries(${name}_test PRIVATE ${target} ${ARG_TEST_DEPENDS} GTest::gtest_main)
    antipode_compile_options(${name}_test)
    gtest_discover_tests(${name}_test DISCOVERY_TIMEOUT 60 WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
  endif()
endfunction()

function(antipode_compile_options target)
  target_compile_options(${target} PRIVATE -Wall -Wextra)
  if(ANTIPODE_SANITIZE)
    # Under the sanitizers GCC warns of uninitialised Eigen matrices where there are none.
    target_compile_options(${target} PRIVATE -fsanitize=${ANTIPODE_SANITIZE} -fno-omit-frame-pointer
      -fno-sanitize-recover=all $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
    target_link_options(${target} PRIVATE -fsanitize=${ANTIPODE_SANITIZE})
  endif()
endfunction()

# The LibTorch headers take 20 seconds to parse: parse them once, in nn, and share the result.
function(antipode_use_torch_precompiled_header target)
  foreach(one ${target} ${ARGN})
    if(NOT TARGET ${one})
      continue()
    endif()
    get_target_property(type ${one} TYPE)
    if(type STREQUAL INTERFACE_LIBRARY)
      continue()
    endif()
    target_precompile_headers(${one} REUSE_FROM antipode_nn)
    if(type STREQUAL EXECUTABLE)
      # The header was compiled with -fPIC, programs get -fPIE.
      target_compile_options(${one} PRIVATE -fPIC)
    endif()
  endforeach()
endfunction()

# Sources that call at::parallel_for, which is compiled into its callers: without OpenMP it runs on one thread, silently.
# FindLibTorch.cmake has looked for it.
function(antipode_parallel_sources)
  if(OpenMP_CXX_FOUND)
    # The precompiled header was made without these flags.
    set_source_files_properties(${ARGN} PROPERTIES COMPILE_OPTIONS ${OpenMP_CXX_FLAGS} SKIP_PRECOMPILE_HEADERS ON)
  endif()
endfunction()
