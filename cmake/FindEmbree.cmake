# Defines Embree::Embree from Embree 4 or 3, whichever the system has.
find_path(Embree_INCLUDE_DIR NAMES embree4/rtcore.h embree3/rtcore.h)
find_library(Embree_LIBRARY NAMES embree4 embree3)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(Embree REQUIRED_VARS Embree_LIBRARY Embree_INCLUDE_DIR)
if(Embree_FOUND AND NOT TARGET Embree::Embree)
  add_library(Embree::Embree UNKNOWN IMPORTED)
  set_target_properties(Embree::Embree PROPERTIES
    IMPORTED_LOCATION ${Embree_LIBRARY} INTERFACE_INCLUDE_DIRECTORIES ${Embree_INCLUDE_DIR})
endif()
mark_as_advanced(Embree_INCLUDE_DIR Embree_LIBRARY)
