"""Imposes mistakes on a right program in Python: what `rosgrade selftest` grades as a mutant.

Its folder comes before the tracer's: Python imports this module at start, and this one imports the
tracer. What the tracer wraps of rclpy is wrapped once more: this code gets what the program says,
and gives the tracer what a wrong program would have said. The mistakes stand in the file beside it,
see mutation.c.
"""

from __future__ import annotations

import os
import sys

_HERE = os.path.dirname(__file__)
sys.path.remove(_HERE)
del sys.modules["sitecustomize"]
import rosgrade_rclpy  # type: ignore[import-not-found]  # noqa: E402
import sitecustomize  # type: ignore[import-not-found]  # noqa: E402, F401 - the tracer's

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

_program = os.path.basename("".join(sys.orig_argv[1:2]))
with open(os.path.join(_HERE, "mutation.txt"), encoding="utf-8") as _file:
    _lines = [line.rstrip("\n").split("\t") for line in _file]
MISTAKES = {(kind, name): value for program, kind, name, value in _lines if program == _program}


def _bound(owner: Any, name: str, change: Any, after: Any = None) -> None:
    """Let `change` alter the arguments of each call of a method, and `after` see its result."""
    import functools
    import inspect

    original = getattr(owner, name)
    signature = inspect.signature(original)

    @functools.wraps(original)
    def changed(*args: Any, **kwargs: Any) -> Any:
        bound = signature.bind(*args, **kwargs)
        bound.apply_defaults()
        seen = change(args[0], bound.arguments)
        result = original(*bound.args, **bound.kwargs)
        if after is not None:
            after(result, seen)
        return result

    setattr(owner, name, changed)


def _renamed(node: Any, given: dict[str, Any], key: str) -> str:
    """The name that the program means, in full; it gets another one."""
    resolve = node.resolve_topic_name if key == "topic" else node.resolve_service_name
    full: str = resolve(given[key])
    given[key] = MISTAKES.get(("rename", full), given[key])
    return full


def _endpoint(node: Any, given: dict[str, Any]) -> str:
    import copy

    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

    topic = _renamed(node, given, "topic")
    qos = given["qos_profile"]
    qos = QoSProfile(depth=qos) if isinstance(qos, int) else copy.copy(qos)
    if value := MISTAKES.get(("reliability", topic)):
        qos.reliability = ReliabilityPolicy[value.upper()]
    if value := MISTAKES.get(("durability", topic)):
        qos.durability = DurabilityPolicy[value.upper()]
    if value := MISTAKES.get(("depth", topic)):
        qos.history, qos.depth = HistoryPolicy.KEEP_LAST, int(value)
    given["qos_profile"] = qos
    if value := MISTAKES.get(("type", topic)):
        import importlib

        package, _, name = value.split("/")
        given["msg_type"] = getattr(importlib.import_module(f"{package}.msg"), name)
    return topic


def _publisher(publisher: Any, topic: str) -> None:
    """Let a publisher send what a mistake makes of its messages."""
    import time

    publish = publisher.publish
    most = MISTAKES.get(("most", topic))
    wrong = MISTAKES.get(("field", topic))

    def published(message: Any) -> None:
        if most is not None and _sent.setdefault(topic, 0) >= int(most):
            return
        _sent[topic] = _sent.get(topic, 0) + 1
        if ("type", topic) in MISTAKES:
            message = publisher.msg_type()
        elif wrong is not None:
            message = _with_wrong(message, *wrong.split())
        publish(message)
        if ("twice", topic) in MISTAKES:
            publish(message)
        if ("blocks", topic) in MISTAKES:
            time.sleep(float(MISTAKES["blocks", topic]))

    publisher.publish = published


_sent: dict[str, int] = {}


def _with_wrong(message: Any, path: str, other: str = "") -> Any:
    """A message with another value in a field, or with its value in another field."""
    import copy

    message = copy.deepcopy(message)
    holder, field = _field(message, path)
    value = getattr(holder, field)
    if other:
        setattr(holder, field, type(value)())
        setattr(*_field(message, other), value)
    elif isinstance(value, str):
        setattr(holder, field, chr(ord(value[0]) ^ 1) + value[1:] if value else value)
    else:
        setattr(holder, field, not value if isinstance(value, bool) else value + 1)
    return message


def _field(message: Any, path: str) -> tuple[Any, str]:
    *outer, field = path.split(".")
    for name in outer:
        message = getattr(message, name)
    return message, field


def _patch_node(module: Any) -> None:
    import atexit
    import signal
    import time

    def wait() -> None:
        while True:
            time.sleep(1.0)

    def named(node: Any, given: dict[str, Any]) -> Any:
        if ("hangs", "node") in MISTAKES:
            wait()
        name = given["node_name"]
        given["node_name"] = MISTAKES.get(("node", name), name)
        given["namespace"] = MISTAKES.get(("namespace", name), given["namespace"])
        if ("ignores", "SIGINT") in MISTAKES:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        if ("lingers", "exit") in MISTAKES:
            atexit.register(wait)
        return node

    def meddling(_: Any, node: Any) -> None:
        from builtin_interfaces.msg import Time

        if too := MISTAKES.get(("publishes", "node")):
            node.create_publisher(Time, too, 10)
        if too := MISTAKES.get(("subscribes", "node")):
            node.create_subscription(Time, too, print, 10)

    def timed(_: Any, given: dict[str, Any]) -> None:
        factor = float(MISTAKES.get(("period", "timers"), "1"))
        given["timer_period_sec"] = given["timer_period_sec"] * factor

    def service(node: Any, given: dict[str, Any]) -> None:
        _renamed(node, given, "srv_name")

    node_class = module.Node
    _bound(node_class, "__init__", named, meddling)
    _bound(node_class, "create_publisher", _endpoint, _publisher)
    _bound(node_class, "create_subscription", _endpoint)
    _bound(node_class, "create_service", service)
    _bound(node_class, "create_client", service)
    _bound(node_class, "create_timer", timed)


def _patch_executors(module: Any) -> None:
    import time

    executor_class = module.Executor
    wait = executor_class.wait_for_ready_callbacks
    raises = MISTAKES.get(("raises", "executor"))
    first: list[float] = []

    def wait_for_ready_callbacks(self: Any, timeout_sec: Any = None, *args: Any, **kw: Any) -> Any:
        if ("ends", "executor") in MISTAKES:
            self.context.try_shutdown()
            raise module.ShutdownException
        while ("never_spins", "executor") in MISTAKES and self.context.ok():
            time.sleep(0.02)
        if raises is None:
            return wait(self, timeout_sec, *args, **kw)
        first.append(time.monotonic())
        left = max(0.0, first[0] + float(raises) - time.monotonic())
        limit = getattr(timeout_sec, "timeout", timeout_sec)
        if limit is not None and 0.0 <= limit < left:
            return wait(self, timeout_sec, *args, **kw)
        try:
            return wait(self, left, *args, **kw)
        except module.TimeoutException:
            raise RuntimeError("a mistake that rosgrade selftest imposes") from None

    executor_class.wait_for_ready_callbacks = wait_for_ready_callbacks


def _after(patch: Any, own: Any) -> Any:
    def both(module: Any) -> None:
        patch(module)
        own(module)

    return both


if MISTAKES:
    for _module, _patch in {
        "rclpy.executors": _patch_executors,
        "rclpy.node": _patch_node,
    }.items():
        rosgrade_rclpy.PATCHES[_module] = _after(rosgrade_rclpy.PATCHES[_module], _patch)
