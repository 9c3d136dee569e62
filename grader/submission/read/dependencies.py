"""Whether a name in package.xml exists, as far as is known without asking the network."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from difflib import get_close_matches
from functools import lru_cache

from grader.submission.read.rosdistro import NOT_IN_JAZZY, PACKAGES, ROSDEP_KEYS

# rosdep names keys after Debian packages; whether one of these is wrong is not judged.
_SYSTEM_KEY = re.compile(
    r"python3?-.+|lib.+|.+-(dev|pip|tools|common|utils|plugins?|perl|py|python|java|bin)"
    r"|(gazebo|ignition|gz|qt|vtk|gstreamer|gcc|g\+\+|llvm|openjdk|ruby|perl|php|font|fonts|texlive"
    r"|linux|lua|nvidia|cuda|opencv|ur)[\d.-].*"
)
_POSSIBLE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]*")
_APT_NAME = re.compile(r"ros-[a-z]+-")
# Names that students type most; here a looser likeness counts as a mistyped name.
_OFTEN = """
rclpy rclcpp std_msgs geometry_msgs sensor_msgs nav_msgs std_srvs example_interfaces
visualization_msgs action_msgs tf2_ros turtlesim launch_ros ament_index_python ament_cmake
"""
_COMMON = frozenset(_OFTEN.split())
# Ratios of :mod:`difflib`: high, since many packages have names alike.
_CUTOFF, _CUTOFF_OFTEN = 0.9, 0.8


def is_known(name: str, *, installed: Collection[str], submitted: Collection[str]) -> bool | None:
    """Tell whether a ROS package or rosdep key of this name exists.

    Returns:
        False when it cannot be the name of either, is known not to exist, or is a mistyped known
        name (:func:`meant`). None when it may exist all the same.
    """
    if name in installed or name in submitted or name in PACKAGES or name in ROSDEP_KEYS:
        return True
    if name in NOT_IN_JAZZY or not _POSSIBLE_NAME.fullmatch(name):
        return False
    if _SYSTEM_KEY.fullmatch(name):
        return True
    return None if meant(name, {*installed, *submitted}) is None else False


def meant(name: str, more: Iterable[str] = ()) -> str | None:
    """The ROS package that was most likely meant by a name that is none, or None.

    It begins with the same letter, and differs only in case, hyphens, a plural, a part such as
    ``.msg``, or few letters.
    """
    key = _folded(re.split(r"[./:\s]", _APT_NAME.sub("", name.strip()), maxsplit=1)[0])
    folded = {_folded(one): one for one in sorted({*PACKAGES, *more})}
    names = {one: package for one, package in folded.items() if one[:1] == key[:1]}
    often = [one for one, package in names.items() if package in _COMMON]
    near = get_close_matches(key, names, 1, _CUTOFF)
    near = near or get_close_matches(key, often, 1, _CUTOFF_OFTEN)
    return names[near[0]] if near else None


@lru_cache(maxsize=4096)
def _folded(name: str) -> str:
    """A name without case, separators and plural."""
    return re.sub(r"[^a-z0-9]", "", name.lower()).removesuffix("s")
