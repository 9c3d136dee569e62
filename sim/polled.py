"""Entities of a node that no executor serves: their owner takes what has arrived."""

from __future__ import annotations

from typing import Any

from rclpy.callback_groups import CallbackGroup


class PolledGroup(CallbackGroup):
    """A callback group that no executor may serve."""

    def can_execute(self, entity: Any) -> bool:
        """Never."""
        return False


def never(*_: Any) -> None:
    """The callback of such an entity, which is never called."""
