# Passed as CMAKE_PROJECT_INCLUDE when ROS comes from Python wheels.
#
# Their exported targets name include directories of the machine that built the wheels, and CMake
# refuses a target whose directory does not exist. At the end of each project's CMakeLists.txt the
# missing ones are taken off the imported targets; nothing that is installed is touched.

function(rosgrade_drop_missing_include_directories)
  get_property(targets DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(directories "${target}" INTERFACE_INCLUDE_DIRECTORIES)
    if(NOT directories)
      continue()
    endif()
    set(kept)
    foreach(directory IN LISTS directories)
      if(directory MATCHES "[$]<" OR EXISTS "${directory}")
        list(APPEND kept "${directory}")
      endif()
    endforeach()
    set_target_properties("${target}" PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${kept}")
  endforeach()
endfunction()

cmake_language(DEFER CALL rosgrade_drop_missing_include_directories)
