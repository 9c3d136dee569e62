"""Rules for names: rosgrade's ids, Python's, and ROS's (REP-144, the ROS 2 topic name design).

Sources: https://ros.org/reps/rep-0144.html,
https://design.ros2.org/articles/topic_and_service_names.html,
https://packaging.python.org/en/latest/specifications/name-normalization/
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Annotated, Literal, get_args

from pydantic import AfterValidator, BeforeValidator, Field, WithJsonSchema

ID = r"[a-z][a-z0-9_]*"
TOPIC = r"(/[A-Za-z_][A-Za-z0-9_]*)+"
NODE = r"[A-Za-z_][A-Za-z0-9_]*"
LIBRARY = r"[A-Za-z0-9]([A-Za-z0-9._-]*[A-Za-z0-9])?"
FRAME = r"[A-Za-z0-9_][A-Za-z0-9_./-]*"
INTERFACE = r"[a-z][a-z0-9_]*/(msg|srv|action)/[A-Z][A-Za-z0-9]*(_FeedbackMessage)?"

FIND_SHARE = re.compile(rf"\$\(find-pkg-share ({ID})\)")
"""The folder ``share/<package>`` of a package, as a launch file in XML or YAML writes it."""


def _rule(pattern: str, words: str) -> Callable[[str], str]:
    """A validator that lets names of one form pass; its ValueError says what is expected."""

    def check(name: str) -> str:
        if not re.fullmatch(pattern, name):
            raise ValueError(f"{name!r} is not {words}")
        return name

    return check


check_id = _rule(ID, "an id: use lower case letters, digits and underscores")
_PACKAGE = (
    "a package name: lower case letters, digits and underscores, beginning with a letter (REP-144)"
)
package_name = _rule(ID, _PACKAGE)
# colcon builds it, with no more than a warning: a student's package may have such a name.
_built_name = _rule(r"[A-Za-z0-9][A-Za-z0-9_-]*", _PACKAGE)
node_name = _rule(NODE, "a node name: letters, digits and underscores, not beginning with a digit")
library_name = _rule(
    LIBRARY,
    "the name of a Python library, such as 'scipy': letters, digits, '-', '_' and '.', without a "
    "version",
)
_full_topic_name = _rule(rf"(?!.*__){TOPIC}", "a ROS topic name: letters, digits, '_' and '/'")
_full_node_name = _rule(rf"(/{NODE})+", "a node name: letters, digits, '_' and '/'")


def topic_name(name: str) -> str:
    """A fully qualified topic or service name."""
    if not name.startswith("/"):
        raise ValueError(f"{name!r} is relative: write the full name, '/{name}'")
    return _full_topic_name(name)


def qualified_node_name(name: str) -> str:
    """A node name with its namespace: ``bot`` is ``/bot``."""
    return _full_node_name(name if name.startswith("/") else f"/{name}")


def namespace(name: str) -> str:
    """A namespace, which begins with a slash; ``/`` is the root."""
    return name if name == "/" else topic_name(name)


def interface_name(name: str) -> str:
    """An interface name such as ``geometry_msgs/msg/Twist``."""
    if not re.fullmatch(INTERFACE, name):
        short = re.fullmatch(r"([a-z][a-z0-9_]*)/([A-Z][A-Za-z0-9]*)", name)
        advice = f" Did you mean '{short[1]}/msg/{short[2]}'?" if short else ""
        raise ValueError(f"{name!r} is not an interface name (package/msg/Type).{advice}")
    return name


def _form(pattern: str, words: str) -> WithJsonSchema:
    """The rule for a name, for editors and for the documentation; a variable may stand in it."""
    pattern = rf"^{pattern}$|\{{[a-z]"
    return WithJsonSchema({"type": "string", "pattern": pattern, "x-words": words})


Id = Annotated[str, AfterValidator(check_id), _form(ID, "id, such as `period_2`")]
PackageName = Annotated[str, AfterValidator(_built_name), _form(ID, "package name")]
NodeName = Annotated[str, AfterValidator(node_name), _form(NODE, "node name")]
QualifiedNodeName = Annotated[str, AfterValidator(qualified_node_name)]
Namespace = Annotated[
    str, AfterValidator(namespace), _form(rf"(/|{TOPIC})", "namespace, such as `/robot`")
]
TopicName = Annotated[str, AfterValidator(topic_name), _form(TOPIC, "topic, such as `/cmd_vel`")]
InterfaceName = Annotated[
    str,
    AfterValidator(interface_name),
    _form(INTERFACE, "interface, such as `geometry_msgs/msg/Twist`"),
]
FrameName = Annotated[
    str,
    AfterValidator(_rule(FRAME, "the name of a frame: no slash in front (REP-105)")),
    _form(FRAME, "frame, such as `base_link`"),
]
LibraryName = Annotated[
    str, AfterValidator(library_name), _form(LIBRARY, "Python library, such as `scipy`")
]

Reliability = Literal["reliable", "best_effort"]
Durability = Literal["volatile", "transient_local"]
BuildType = Literal["ament_python", "ament_cmake"]
BuildTypes = Annotated[
    tuple[BuildType, ...],
    Field(min_length=1),
    BeforeValidator(lambda given: tuple(given) if isinstance(given, list | tuple) else (given,)),
    WithJsonSchema(
        {
            "anyOf": [
                {"enum": list(get_args(BuildType))},
                {"type": "array", "items": {"enum": list(get_args(BuildType))}, "minItems": 1},
            ],
            "x-words": "`ament_python`, `ament_cmake`, or a list of both",
        }
    ),
]
