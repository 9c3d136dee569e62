"""Packages as students hand them in, made file by file."""

from __future__ import annotations

import io
import tarfile
import zipfile
from pathlib import Path

MANIFEST = """\
<?xml version="1.0"?>
<package format="3">
  <name>bot_publisher</name>
  <version>0.0.0</version>
  <description>Publishes a Twist</description>
  <maintainer email="ada@example.org">Ada</maintainer>
  <license>Apache-2.0</license>
  <depend>rclpy</depend>
  <depend>geometry_msgs</depend>
  <export>
    <build_type>ament_python</build_type>
  </export>
</package>
"""
SETUP_PY = """\
from setuptools import find_packages, setup

package_name = 'bot_publisher'

setup(
    name=package_name,
    version='0.0.0',
    packages=find_packages(exclude=['test']),
    data_files=[
        ('share/ament_index/resource_index/packages', ['resource/' + package_name]),
        ('share/' + package_name, ['package.xml']),
    ],
    install_requires=['setuptools'],
    zip_safe=True,
    maintainer='Ada',
    maintainer_email='ada@example.org',
    description='Publishes a Twist',
    license='Apache-2.0',
    entry_points={
        'console_scripts': [
            'bot_pub = bot_publisher.node:main',
        ],
    },
)
"""
SETUP_CFG = """\
[develop]
script_dir=$base/lib/bot_publisher
[install]
install_scripts=$base/lib/bot_publisher
"""
NODE = """\
import rclpy
from geometry_msgs.msg import Twist


def main():
    rclpy.init()
    print(Twist())
"""
PACKAGE = {
    "package.xml": MANIFEST,
    "setup.py": SETUP_PY,
    "setup.cfg": SETUP_CFG,
    "resource/bot_publisher": "",
    "bot_publisher/__init__.py": "",
    "bot_publisher/node.py": NODE,
}
"""A good ament_python package, what ``ros2 pkg create`` and a lecture make."""
MANIFEST_OF_MSGS = (
    MANIFEST.replace("bot_publisher", "bot_msgs")
    .replace("ament_python", "ament_cmake")
    .replace(
        "<depend>rclpy</depend>",
        "<buildtool_depend>ament_cmake</buildtool_depend>"
        "<depend>rosidl_default_generators</depend>"
        "<member_of_group>rosidl_interface_packages</member_of_group>",
    )
)
CMAKE_OF_MSGS = """\
cmake_minimum_required(VERSION 3.8)
project(bot_msgs)
find_package(ament_cmake REQUIRED)
find_package(geometry_msgs REQUIRED)
find_package(rosidl_default_generators REQUIRED)
rosidl_generate_interfaces(${PROJECT_NAME} "msg/Bot.msg" DEPENDENCIES geometry_msgs)
if(BUILD_TESTING)
  find_package(ament_lint_auto REQUIRED)
endif()
ament_package()
"""
INTERFACES = {
    "src/bot_msgs/package.xml": MANIFEST_OF_MSGS,
    "src/bot_msgs/CMakeLists.txt": CMAKE_OF_MSGS,
    "src/bot_msgs/msg/Bot.msg": "uint8 BURGER=1\nuint8 model\ngeometry_msgs/Pose2D pose\n",
}
"""A good package with a message."""


class Tree:
    """A folder that is filled with a few words."""

    def __init__(self, root: Path) -> None:
        self.root = root

    def write(self, files: dict[str, str | bytes]) -> Path:
        """Write files below the root, which is returned."""
        for name, content in files.items():
            path = self.root / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content.encode() if isinstance(content, str) else content)
        return self.root

    def package(
        self, changes: dict[str, str | None] | None = None, folder: str = "src/bot_publisher"
    ) -> Path:
        """Write the good package into a folder below the root, which is returned.

        Args:
            changes: File -> other content, or None to leave it out.
            folder: Where the package goes.
        """
        files = {**PACKAGE, **(changes or {})}
        return self.write({f"{folder}/{n}": text for n, text in files.items() if text is not None})


def zip_bytes(*members: tuple[str, bytes], **attributes: int) -> bytes:
    """Make a zip of members, also of those that no tool would make."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members:
            info = zipfile.ZipInfo(name)
            info.create_system = 3
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = attributes.get("mode", 0o100644) << 16
            archive.writestr(info, content)
    return buffer.getvalue()


def tar_member(name: str, content: bytes = b"", **fields: object) -> tuple[tarfile.TarInfo, bytes]:
    """Make a member of a tar, ``fields`` being attributes of TarInfo."""
    info = tarfile.TarInfo(name)
    info.size = len(content)
    for field, value in fields.items():
        setattr(info, field, value)
    return info, content


def tar_bytes(*members: tuple[tarfile.TarInfo, bytes], mode: str = "w:gz") -> bytes:
    """Make a tar of members, compressed as ``mode`` says."""
    buffer = io.BytesIO()
    with tarfile.open(fileobj=buffer, mode=mode) as archive:  # type: ignore[call-overload]
        for info, content in members:
            archive.addfile(info, io.BytesIO(content))
    return buffer.getvalue()
