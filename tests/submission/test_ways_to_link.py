"""Every way in which a CMakeLists.txt may use the packages of ROS builds here as elsewhere."""

from __future__ import annotations

from pathlib import Path

import pytest

from grader.machine import ros as ros_module
from grader.submission.prepare import Preparation, prepare
from tests.submission.samples import MANIFEST, Tree

pytestmark = [pytest.mark.ros, pytest.mark.compiles, pytest.mark.slow]

# rcl links to the tracing library, as rclcpp does, and is part of the wheels.
CODE = """\
#include <cstdio>
#include <geometry_msgs/msg/twist.hpp>
#include <rcl/rcl.h>

int main()
{
  rcl_context_t context = rcl_get_zero_initialized_context();
  geometry_msgs::msg::Twist twist;
  std::printf("%d %g\\n", rcl_context_is_valid(&context), twist.linear.x);
}
"""
FINDS = "find_package(rcl REQUIRED)\nfind_package(geometry_msgs REQUIRED)\n"
PROGRAM = "add_executable(bot ${CMAKE_SOURCE_DIR}/bot.cpp)\n"
INSTALLS = "install(TARGETS bot DESTINATION lib/${PROJECT_NAME})\n"
INCLUDES = "${rcl_INCLUDE_DIRS} ${geometry_msgs_INCLUDE_DIRS}"
LIBRARIES = "${rcl_LIBRARIES} ${geometry_msgs_LIBRARIES}"
WAYS = {
    "by_ament": f"{FINDS}{PROGRAM}ament_target_dependencies(bot rcl geometry_msgs)\n{INSTALLS}",
    "by_targets": f"{FINDS}{PROGRAM}target_link_libraries(bot PRIVATE rcl::rcl\n"
    f"  geometry_msgs::geometry_msgs__rosidl_typesupport_cpp)\n{INSTALLS}",
    "by_lists_of_targets": f"{FINDS}{PROGRAM}"
    f"target_link_libraries(bot ${{rcl_TARGETS}} ${{geometry_msgs_TARGETS}})\n{INSTALLS}",
    "by_variables": f"{FINDS}{PROGRAM}target_include_directories(bot PUBLIC {INCLUDES})\n"
    f"target_link_libraries(bot {LIBRARIES})\n{INSTALLS}",
    "of_old": f"{FINDS}include_directories(include {INCLUDES})\n"
    f"link_directories(${{rcl_LIBRARY_DIRS}})\nlink_libraries({LIBRARIES})\n{PROGRAM}{INSTALLS}",
    "by_names": f"{FINDS}link_directories(${{rcl_DIR}}/../../../lib)\n{PROGRAM}"
    "ament_target_dependencies(bot rcl geometry_msgs)\n"
    f"target_link_libraries(bot rcl tracetools lttng-ust -llttng-ust dl)\n{INSTALLS}",
    "below": "add_subdirectory(below)\n",
    "exports": f"{FINDS}add_library(twists SHARED bot.cpp)\n"
    "ament_target_dependencies(twists rcl geometry_msgs)\n"
    "install(TARGETS twists EXPORT export_twists DESTINATION lib)\n"
    "ament_export_targets(export_twists)\nament_export_libraries(twists)\n"
    "ament_export_dependencies(rcl geometry_msgs)\n",
    "rests": f"find_package(exports REQUIRED)\n{PROGRAM}"
    "target_include_directories(bot PUBLIC ${exports_INCLUDE_DIRS})\n"
    f"target_link_libraries(bot ${{exports_LIBRARIES}} exports::twists)\n{INSTALLS}",
}


def test_every_way_to_use_a_package_of_ros_in_cmake_builds(tree: Tree, tmp_path: Path) -> None:
    for name, way in WAYS.items():
        cmake = (
            f"cmake_minimum_required(VERSION 3.8)\nproject({name})\n"
            f"find_package(ament_cmake REQUIRED)\n{way}ament_package()\n"
        )
        depends = "<depend>rcl</depend>" + "<depend>exports</depend>" * (name == "rests")
        manifest = (
            MANIFEST.replace("bot_publisher", name)
            .replace("ament_python", "ament_cmake")
            .replace("<depend>rclpy</depend>", depends)
        )
        tree.write(
            {
                f"src/{name}/package.xml": manifest,
                f"src/{name}/CMakeLists.txt": cmake,
                f"src/{name}/bot.cpp": CODE,
            }
        )
    tree.write({"src/below/below/CMakeLists.txt": WAYS["by_ament"]})
    build = prepare(
        tree.root, Preparation(ros=ros_module.find(), cache=tmp_path / "cache")
    ).record.build
    assert build is not None
    assert (build.failed_packages, "Warning" in build.log) == ((), False), build.log
