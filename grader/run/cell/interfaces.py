"""What rclpy needs of a topic or a service, from the words of the YAML: message class and QoS."""

from __future__ import annotations

import importlib
from typing import Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from grader.recording.interface import FEEDBACK


def import_interface(name: str) -> Any:
    """Import the class of an interface such as ``std_msgs/msg/String``."""
    package, kind, short = name.removesuffix(FEEDBACK).split("/")
    try:
        interface = getattr(importlib.import_module(f"{package}.{kind}"), short)
        return interface.Impl.FeedbackMessage if name.endswith(FEEDBACK) else interface
    except AttributeError as error:
        raise ImportError(f"no interface {name}") from error


def qos_profile(reliability: str, durability: str, depth: int) -> QoSProfile:
    """A profile with history keep_last."""
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy[reliability.upper()],
        durability=DurabilityPolicy[durability.upper()],
    )
