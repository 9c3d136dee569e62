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


def _change_arguments(owner: Any, name: str, change: Any, after: Any = None) -> None:
    """Let `change` alter the arguments of each call of a method by their names.

    `after` is called with the method's result, and with what `change` returned.
    """
    import functools
    import inspect

    original = getattr(owner, name)
    signature = inspect.signature(original)

    @functools.wraps(original)
    def changed(*args: Any, **kwargs: Any) -> Any:
        bound = signature.bind(*args, **kwargs)
        bound.apply_defaults()
        meant = change(args[0], bound.arguments)
        result = original(*bound.args, **bound.kwargs)
        if after is not None:
            after(result, meant)
        return result

    setattr(owner, name, changed)


def _rename(node: Any, arguments: dict[str, Any], key: str) -> str:
    """Replace a name in the arguments by a wrong one; returns the right one, in full."""
    resolve = node.resolve_topic_name if key == "topic" else node.resolve_service_name
    full: str = resolve(arguments[key])
    arguments[key] = MISTAKES.get(("rename", full), arguments[key])
    return full


def _change_endpoint(node: Any, arguments: dict[str, Any]) -> str:
    """Replace name, QoS and type of an endpoint by wrong ones; returns its right topic."""
    import copy

    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

    topic = _rename(node, arguments, "topic")
    qos = arguments["qos_profile"]
    qos = QoSProfile(depth=qos) if isinstance(qos, int) else copy.copy(qos)
    if value := MISTAKES.get(("reliability", topic)):
        qos.reliability = ReliabilityPolicy[value.upper()]
    if value := MISTAKES.get(("durability", topic)):
        qos.durability = DurabilityPolicy[value.upper()]
    if value := MISTAKES.get(("depth", topic)):
        qos.history, qos.depth = HistoryPolicy.KEEP_LAST, int(value)
    arguments["qos_profile"] = qos
    if value := MISTAKES.get(("type", topic)):
        import importlib

        package, _, name = value.split("/")
        arguments["msg_type"] = getattr(importlib.import_module(f"{package}.msg"), name)
    return topic


def _change_messages(publisher: Any, topic: str) -> None:
    """Let a publisher send what a mistake makes of its messages."""
    import time

    publish = publisher.publish
    most = MISTAKES.get(("most", topic))
    wrong_field = MISTAKES.get(("field", topic))

    def publish_wrongly(message: Any) -> None:
        if most is not None and _sent.get(topic, 0) >= int(most):
            return
        _sent[topic] = _sent.get(topic, 0) + 1
        if ("type", topic) in MISTAKES:
            message = publisher.msg_type()
        elif wrong_field is not None:
            message = _with_wrong_field(message, *wrong_field.split())
        publish(message)
        if ("twice", topic) in MISTAKES:
            publish(message)
        if ("blocks", topic) in MISTAKES:
            time.sleep(float(MISTAKES["blocks", topic]))

    publisher.publish = publish_wrongly


_sent: dict[str, int] = {}
"""Topic -> number of its messages so far."""


def _with_wrong_field(message: Any, path: str, other_path: str = "") -> Any:
    """A message with another value in a field, or with its value in another field."""
    import copy

    message = copy.deepcopy(message)
    holder, field = _holder_of(message, path)
    value = getattr(holder, field)
    if other_path:
        setattr(holder, field, type(value)())
        setattr(*_holder_of(message, other_path), value)
    elif isinstance(value, str):
        if value:
            setattr(holder, field, chr(ord(value[0]) ^ 1) + value[1:])
    elif isinstance(value, bool):
        setattr(holder, field, not value)
    else:
        setattr(holder, field, value + 1)
    return message


def _holder_of(message: Any, path: str) -> tuple[Any, str]:
    """The part of a message that a path such as ``linear.x`` leads to, and the field in it."""
    *outer, field = path.split(".")
    for name in outer:
        message = getattr(message, name)
    return message, field


def _patch_node(module: Any) -> None:
    import atexit
    import signal
    import time

    def wait_forever() -> None:
        while True:
            time.sleep(1.0)

    def change_node(node: Any, arguments: dict[str, Any]) -> Any:
        if ("hangs", "node") in MISTAKES:
            wait_forever()
        name = arguments["node_name"]
        arguments["node_name"] = MISTAKES.get(("node", name), name)
        arguments["namespace"] = MISTAKES.get(("namespace", name), arguments["namespace"])
        if ("ignores", "SIGINT") in MISTAKES:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
        if ("lingers", "exit") in MISTAKES:
            atexit.register(wait_forever)
        return node

    def add_endpoints(_: Any, node: Any) -> None:
        from builtin_interfaces.msg import Time

        if topic := MISTAKES.get(("publishes", "node")):
            node.create_publisher(Time, topic, 10)
        if topic := MISTAKES.get(("subscribes", "node")):
            node.create_subscription(Time, topic, print, 10)

    def change_timer(_: Any, arguments: dict[str, Any]) -> None:
        arguments["timer_period_sec"] *= float(MISTAKES.get(("period", "timers"), "1"))

    def change_service(node: Any, arguments: dict[str, Any]) -> None:
        _rename(node, arguments, "srv_name")

    node_class = module.Node
    _change_arguments(node_class, "__init__", change_node, add_endpoints)
    _change_arguments(node_class, "create_publisher", _change_endpoint, _change_messages)
    _change_arguments(node_class, "create_subscription", _change_endpoint)
    _change_arguments(node_class, "create_service", change_service)
    _change_arguments(node_class, "create_client", change_service)
    _change_arguments(node_class, "create_timer", change_timer)


def _patch_executors(module: Any) -> None:
    import time

    executor_class = module.Executor
    wait = executor_class.wait_for_ready_callbacks
    raises_after_s = MISTAKES.get(("raises", "executor"))
    first_waits_s: list[float] = []

    def wait_for_ready_callbacks(self: Any, timeout_sec: Any = None, *args: Any, **kw: Any) -> Any:
        if ("ends", "executor") in MISTAKES:
            self.context.try_shutdown()
            raise module.ShutdownException
        while ("never_spins", "executor") in MISTAKES and self.context.ok():
            time.sleep(0.02)
        if raises_after_s is None:
            return wait(self, timeout_sec, *args, **kw)
        if not first_waits_s:
            first_waits_s.append(time.monotonic())
        left_s = max(0.0, first_waits_s[0] + float(raises_after_s) - time.monotonic())
        limit_s = getattr(timeout_sec, "timeout", timeout_sec)
        if limit_s is not None and 0.0 <= limit_s < left_s:
            return wait(self, timeout_sec, *args, **kw)
        try:
            return wait(self, left_s, *args, **kw)
        except module.TimeoutException:
            raise RuntimeError("a mistake that rosgrade selftest imposes") from None

    executor_class.wait_for_ready_callbacks = wait_for_ready_callbacks


def _both(trace: Any, impose: Any) -> Any:
    def patch(module: Any) -> None:
        trace(module)
        impose(module)

    return patch


if MISTAKES:
    for _module, _impose in {
        "rclpy.executors": _patch_executors,
        "rclpy.node": _patch_node,
    }.items():
        rosgrade_rclpy.PATCHES[_module] = _both(rosgrade_rclpy.PATCHES[_module], _impose)
