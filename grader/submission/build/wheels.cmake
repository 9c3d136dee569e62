# Passed as CMAKE_PROJECT_INCLUDE when ROS comes from Python wheels.
#
# Their exported targets name include directories and libraries of the machine that built the
# wheels, and CMake refuses a target whose directory does not exist, ninja one whose library does
# not. At the end of each project's CMakeLists.txt what is missing is taken off the imported
# targets; nothing that is installed is touched.

# Libraries of the wheels for Python have symbols that only an interpreter defines.
add_link_options(-Wl,--as-needed -Wl,--allow-shlib-undefined)

# LTTng is not part of the wheels, and nothing that they are used for needs it. An empty library
# stands in for it, however a package links to it: by a target, a variable, a name or a path.
file(WRITE "${CMAKE_BINARY_DIR}/stand-ins/liblttng-ust.so" "/* empty */\n")
list(APPEND CMAKE_LIBRARY_PATH "${CMAKE_BINARY_DIR}/stand-ins")
add_link_options("-L${CMAKE_BINARY_DIR}/stand-ins")

# Also those that a CMakeLists.txt in a subdirectory finds can be seen at the end.
set(CMAKE_FIND_PACKAGE_TARGETS_GLOBAL ON)

function(rosgrade_drop_missing target property)
  get_target_property(entries "${target}" "${property}")
  if(NOT entries)
    return()
  endif()
  set(kept)
  foreach(entry IN LISTS entries)
    if(NOT IS_ABSOLUTE "${entry}" OR EXISTS "${entry}")
      list(APPEND kept "${entry}")
    endif()
  endforeach()
  set_target_properties("${target}" PROPERTIES "${property}" "${kept}")
endfunction()

function(rosgrade_drop_missing_below directory)
  get_property(targets DIRECTORY "${directory}" PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    if(TARGET "${target}")
      rosgrade_drop_missing("${target}" INTERFACE_INCLUDE_DIRECTORIES)
      rosgrade_drop_missing("${target}" INTERFACE_LINK_LIBRARIES)
    endif()
  endforeach()
  get_property(directories DIRECTORY "${directory}" PROPERTY SUBDIRECTORIES)
  foreach(below IN LISTS directories)
    rosgrade_drop_missing_below("${below}")
  endforeach()
endfunction()

cmake_language(DEFER CALL rosgrade_drop_missing_below "${CMAKE_CURRENT_SOURCE_DIR}")
