"""Names of ROS 2 Jazzy packages, libraries and rosdep keys, from ``rosdistro.yaml`` beside it."""

from __future__ import annotations

from pathlib import Path

import yaml

_LISTS = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8"))

PACKAGES = frozenset(" ".join(_LISTS["packages"].values()).split())
"""Packages of Jazzy, or of sources that courses build beside it."""
NOT_IN_JAZZY = frozenset(_LISTS["not in Jazzy"].split())
"""Names that students take from ROS 1, or from a build type, and that are no packages of Jazzy."""
UNKNOWN_TO_CMAKE = frozenset(_LISTS["unknown to CMake"].split())
"""Packages of Jazzy that ``find_package()`` does not find, as their setup.py builds them."""
ROSDEP_KEYS = frozenset(_LISTS["rosdep keys"].split())
"""rosdep keys of system packages; most are known by pattern, in ``dependencies.py``."""
LIBRARIES: dict[str, str] = _LISTS["libraries"]
"""Module of a Python library on which packages of Jazzy depend -> its name for pip."""

_INTERFACE_ENDINGS = ("_msgs", "_interfaces", "_srvs", "_msg")
PYTHON_MODULES: dict[str, tuple[str, ...]] = {
    **{name: (name,) for name in PACKAGES if name.endswith(_INTERFACE_ENDINGS)},
    **{name: (name,) for name in _LISTS["with a Python module"].split()},
    "PyKDL": ("python_orocos_kdl_vendor",),
    "moveit": ("moveit_py",),
    # The tutorials declare tf2_ros, but since Foxy its Python half is a package of its own.
    "tf2_ros": ("tf2_ros", "tf2_ros_py"),
}
"""Importable module -> packages, any of which provides it.

The first is the one that people declare, the last the one that installs the module.
"""
