"""Rules for names: ids of ours, Python's, and ROS's (REP-144, the ROS 2 topic name design).

Sources: https://ros.org/reps/rep-0144.html,
https://design.ros2.org/articles/topic_and_service_names.html
"""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import AfterValidator, WithJsonSchema

ID = r"[a-z][a-z0-9_]*"
TOPIC = r"(/[A-Za-z_][A-Za-z0-9_]*)+"
NODE = r"[A-Za-z_][A-Za-z0-9_]*"
LIBRARY = r"[A-Za-z0-9]([A-Za-z0-9._-]*[A-Za-z0-9])?"
INTERFACE = r"[a-z][a-z0-9_]*/(msg|srv|action)/[A-Z][A-Za-z0-9]*"


def check_id(name: str) -> str:
    """An id of ours: lower case letters, digits and underscores.

    Raises:
        ValueError: It is anything else.
    """
    if not re.fullmatch(ID, name):
        raise ValueError(f"{name!r} is not an id: use lower case letters, digits and underscores")
    return name


def package_name(name: str) -> str:
    """A package name (REP-144).

    Raises:
        ValueError: It is not one.
    """
    if not re.fullmatch(ID, name):
        raise ValueError(
            f"{name!r} is not a package name: lower case letters, digits and underscores, "
            "beginning with a letter (REP-144)"
        )
    return name


def topic_name(name: str) -> str:
    """A fully qualified topic or service name.

    Raises:
        ValueError: It is relative, or has characters that ROS does not allow.
    """
    if not name.startswith("/"):
        raise ValueError(f"{name!r} is relative: write the full name, '/{name}'")
    if not re.fullmatch(TOPIC, name) or "__" in name:
        raise ValueError(f"{name!r} is not a ROS topic name: letters, digits, '_' and '/'")
    return name


def node_name(name: str) -> str:
    """A node name without its namespace.

    Raises:
        ValueError: It is not one.
    """
    if not re.fullmatch(NODE, name):
        raise ValueError(
            f"{name!r} is not a node name: letters, digits and underscores, not beginning "
            "with a digit"
        )
    return name


def qualified_node_name(name: str) -> str:
    """A node name with its namespace: ``bot`` is ``/bot``.

    Raises:
        ValueError: It is not the name of a node.
    """
    full = name if name.startswith("/") else f"/{name}"
    if not re.fullmatch(rf"(/{NODE})+", full):
        raise ValueError(f"{name!r} is not a node name: letters, digits, '_' and '/'")
    return full


def namespace(name: str) -> str:
    """A namespace, which begins with a slash; ``/`` is the root.

    Raises:
        ValueError: It is relative, or has characters that ROS does not allow.
    """
    return name if name == "/" else topic_name(name)


def interface_name(name: str) -> str:
    """An interface name such as ``geometry_msgs/msg/Twist``.

    Raises:
        ValueError: It has another form.
    """
    if not re.fullmatch(INTERFACE, name):
        short = re.fullmatch(r"([a-z][a-z0-9_]*)/([A-Z][A-Za-z0-9]*)", name)
        remedy = f" Did you mean '{short[1]}/msg/{short[2]}'?" if short else ""
        raise ValueError(f"{name!r} is not an interface name (package/msg/Type).{remedy}")
    return name


def library_name(name: str) -> str:
    """The name of a Python distribution, as pip knows it.

    Source: https://packaging.python.org/en/latest/specifications/name-normalization/

    Raises:
        ValueError: It has another form, such as a module's with a dot, or a version.
    """
    if not re.fullmatch(LIBRARY, name):
        raise ValueError(
            f"{name!r} is not the name of a Python library, such as 'scipy': letters, digits, "
            "'-', '_' and '.', without a version"
        )
    return name


def _form(pattern: str, words: str) -> WithJsonSchema:
    """The rule for a name, for editors and for the documentation."""
    return WithJsonSchema({"type": "string", "pattern": f"^{pattern}$", "x-words": words})


Id = Annotated[str, AfterValidator(check_id), _form(ID, "id, such as `period_2`")]
PackageName = Annotated[str, AfterValidator(package_name), _form(ID, "package name")]
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
LibraryName = Annotated[
    str, AfterValidator(library_name), _form(LIBRARY, "Python library, such as `scipy`")
]

Reliability = Literal["reliable", "best_effort"]
Durability = Literal["volatile", "transient_local"]
