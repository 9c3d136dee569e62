# Passed as CMAKE_PROJECT_INCLUDE when ROS comes from Python wheels.
#
# Their exported targets name include directories and libraries of the machine that built the
# wheels, and CMake refuses a target whose directory does not exist, ninja one whose library does
# not. At the end of each project's CMakeLists.txt what is missing is taken off the imported
# targets; nothing that is installed is touched.

# Libraries of the wheels for Python have symbols that only an interpreter defines.
add_link_options(-Wl,--as-needed -Wl,--allow-shlib-undefined)

function(rosgrade_drop_missing target property)
  get_target_property(entries "${target}" "${property}")
  if(NOT entries)
    return()
  endif()
  set(kept)
  foreach(entry IN LISTS entries)
    # LTTng is not part of the wheels, and nothing that they are used for needs it.
    if(NOT entry STREQUAL "lttng-ust" AND (NOT IS_ABSOLUTE "${entry}" OR EXISTS "${entry}"))
      list(APPEND kept "${entry}")
    endif()
  endforeach()
  set_target_properties("${target}" PROPERTIES "${property}" "${kept}")
endfunction()

function(rosgrade_drop_missing_of_imported_targets)
  get_property(targets DIRECTORY PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    rosgrade_drop_missing("${target}" INTERFACE_INCLUDE_DIRECTORIES)
    rosgrade_drop_missing("${target}" INTERFACE_LINK_LIBRARIES)
  endforeach()
endfunction()

cmake_language(DEFER CALL rosgrade_drop_missing_of_imported_targets)
