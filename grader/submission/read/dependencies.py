"""Whether a name in package.xml exists, as far as is known without asking the network."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
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

    It differs only in case, hyphens, a plural or a part such as ``.msg``, or by one letter (two in
    long names).
    """
    key = _folded(re.split(r"[./:\s]", _APT_NAME.sub("", name.strip()), maxsplit=1)[0])
    near = []
    for candidate in (*PACKAGES, *more):
        folded, most = _folded(candidate), _most_wrong(candidate)
        if abs(len(folded) - len(key)) <= most:
            distance = _distance(key, folded, most)
            if distance is not None:
                near.append((distance, candidate))
    return min(near)[1] if near else None


@lru_cache(maxsize=4096)
def _folded(name: str) -> str:
    """A name without case, separators and plural."""
    return re.sub(r"[^a-z0-9]", "", name.lower()).removesuffix("s")


def _most_wrong(candidate: str) -> int:
    """How many letters may differ: few, since many packages have names alike."""
    stem = candidate.removesuffix("_msgs").removesuffix("_interfaces")
    if candidate in _COMMON:
        return 2 if len(stem) > 5 else 1
    if len(stem) < 5:
        return 0
    return 1 if len(stem) < 10 else 2


def _distance(left: str, right: str, most: int) -> int | None:
    """Count the letters changed, missing, added or swapped, or None if more than ``most``."""
    if not most:
        return 0 if left == right else None
    before: list[int] = []
    row = list(range(len(right) + 1))
    for i, char in enumerate(left, start=1):
        last, before_last = row, before
        row = [i]
        for j, other in enumerate(right, start=1):
            cost = min(last[j] + 1, row[j - 1] + 1, last[j - 1] + (char != other))
            if i > 1 and j > 1 and char == right[j - 2] and left[i - 2] == other:
                cost = min(cost, before_last[j - 2] + 1)
            row.append(cost)
        before = last
        if min(row) > most:
            return None
    return row[-1] if row[-1] <= most else None
