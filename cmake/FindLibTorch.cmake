# Defines LibTorch::LibTorch from the folder LIBTORCH, else from the virtual environment .venv.
#
# TorchConfig.cmake is not used: with a CUDA build of torch it demands a CUDA toolkit, which linking does not need.
set(candidates ${LIBTORCH})
if(NOT LIBTORCH)
  file(GLOB candidates ${PROJECT_SOURCE_DIR}/.venv/lib/python3*/site-packages/torch)
endif()
find_path(LibTorch_INCLUDE_DIR NAMES torch/script.h PATHS ${candidates} PATH_SUFFIXES include NO_DEFAULT_PATH)
foreach(name torch torch_cpu c10)
  find_library(LibTorch_${name}_LIBRARY NAMES ${name} PATHS ${candidates} PATH_SUFFIXES lib NO_DEFAULT_PATH)
endforeach()
foreach(name torch_cuda c10_cuda)
  find_library(LibTorch_${name}_LIBRARY NAMES ${name} PATHS ${candidates} PATH_SUFFIXES lib NO_DEFAULT_PATH)
endforeach()

include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(LibTorch
  REQUIRED_VARS LibTorch_torch_LIBRARY LibTorch_torch_cpu_LIBRARY LibTorch_c10_LIBRARY LibTorch_INCLUDE_DIR
  REASON_FAILURE_MESSAGE "run 'make setup' first, or pass -DLIBTORCH=DIR with the torch folder of a Python environment or a LibTorch download")

if(LibTorch_FOUND AND NOT TARGET LibTorch::LibTorch)
  add_library(LibTorch::LibTorch INTERFACE IMPORTED GLOBAL)
  target_include_directories(LibTorch::LibTorch SYSTEM INTERFACE
    ${LibTorch_INCLUDE_DIR} ${LibTorch_INCLUDE_DIR}/torch/csrc/api/include)
  set(libraries ${LibTorch_torch_LIBRARY} ${LibTorch_torch_cpu_LIBRARY} ${LibTorch_c10_LIBRARY})
  if(LibTorch_torch_cuda_LIBRARY)
    # Nothing refers to the CUDA library by name; it registers itself when loaded, so the linker must keep it.
    list(APPEND libraries -Wl,--no-as-needed ${LibTorch_torch_cuda_LIBRARY} ${LibTorch_c10_cuda_LIBRARY} -Wl,--as-needed)
  endif()
  get_filename_component(LibTorch_LIBRARY_DIR ${LibTorch_c10_LIBRARY} DIRECTORY)
  target_link_libraries(LibTorch::LibTorch INTERFACE ${libraries})
  # For callers of at::parallel_for, see antipode_parallel_sources. LibTorch brings the library under the same name.
  find_package(OpenMP COMPONENTS CXX)
  if(OpenMP_CXX_FOUND)
    target_link_libraries(LibTorch::LibTorch INTERFACE $<LINK_ONLY:OpenMP::OpenMP_CXX>)
  endif()
  # First among the shared libraries: the BLAS that other libraries bring (ATLAS, the reference BLAS) defines the same
  # symbols as the MKL inside LibTorch, and the first one loaded serves every matrix product of all of them.
  target_link_options(LibTorch::LibTorch INTERFACE
    LINKER:--push-state,--no-as-needed ${LibTorch_torch_cpu_LIBRARY} LINKER:--pop-state)
endif()
