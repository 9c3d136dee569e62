"""What the tracer wraps of rclpy; loaded with the first module of rclpy that is imported."""

from __future__ import annotations

import collections
import gc
import itertools
import os
import select
import sys
import weakref

from rosgrade_report import (  # type: ignore[import-not-found]
    HELD_TOPICS,
    INSTALL,
    LEAST_THREADS,
    MIDDLEWARE,
    PAUSE_FD,
    PAUSE_PIPE,
    SEEN_FD,
    THRESHOLDS,
    middleware_variables,
    pipe_at,
    quietly,
    report,
)
from rosgrade_standing import watch  # type: ignore[import-not-found]

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

_HOLD_LIMIT_S = 2.0
_HOLD_POLL_S = 0.002
_PAUSE_POLL_S = 0.005
_FLUSH_LIMIT_S = 0.5
_SEEN_LIMIT_S = 2.0
_SLICE_S = 0.5
_TOPICS_OF_RCLPY = ("/parameter_events", "/rosout")
_MOST_RUNS = 1000
_SHORT_NS = 1_000_000
"""Of shorter calls of callbacks only some are reported: those numbered 1, 2, 4, 8, ..."""
_FIRST_SHORT = 20
"""And so many of those that overlap another call."""

_endpoints: dict[int, tuple[int, str, str]] = {}
"""Publishers and subscriptions that are not destroyed: id -> number of the report, kind, topic."""
_endpoint_numbers = itertools.count()
_messages: dict[str, int] = {}
"""Topic of the probe's -> number of messages so far."""
_held_publishers: list[Any] = []
_held: set[tuple[str, str]] = set()
"""Name of the node, and topic, of publishers that were held."""
_has_unseen_nodes = [False]
_added: set[str] = set()
"""Names of nodes that were added to an executor."""
_spun: Any = weakref.WeakSet()
"""Executors that have looked for work."""
_has_paused = [False]
_began: dict[int, list[tuple[int, int, int]]] = {}
"""The calls of callbacks that still run: id of the timer, subscription or service -> when each
began, how many others ran then, and its number."""
_running: set[int] = set()
"""Numbers of the calls that still run."""
_run_numbers = itertools.count(1)
_newest_run = [0]
_calls: dict[tuple[int, bool], Any] = collections.defaultdict(lambda: itertools.count(1))
"""Id of the timer, subscription or service, and whether calls overlapped -> number of the next."""
_reported_runs = itertools.count()
_pause_poll = select.poll()
if PAUSE_PIPE is not None:
    _pause_poll.register(PAUSE_FD, select.POLLIN)


def _full_name(node: Any) -> str:
    return str(node.get_namespace().rstrip("/") + "/" + node.get_name())


def _type_name(interface: Any) -> str:
    module = interface.__module__.split(".")
    return "/".join([module[0], module[1] if len(module) > 1 else "msg", interface.__name__])


def _qos(profile: Any) -> dict[str, Any]:
    return {
        "reliability": profile.reliability.name.lower(),
        "durability": profile.durability.name.lower(),
        "history": profile.history.name.lower(),
        "depth": profile.depth,
    }


def _group(group: Any, node: Any) -> dict[str, Any]:
    actual = group if group is not None else node.default_callback_group
    return {"type": type(actual).__name__, "id": id(actual)}


def _place() -> dict[str, Any]:
    """File and line of the student's program that does something now, if any."""
    if not INSTALL:
        return {}
    frame: Any = sys._getframe()
    while frame is not None and not frame.f_code.co_filename.startswith(f"{INSTALL}/"):
        frame = frame.f_back
    return {"file": frame.f_code.co_filename, "line": frame.f_lineno} if frame else {}


def _is_power_of_two(number: int) -> bool:
    return not number & (number - 1)


def _callback_name(callback: Any) -> str:
    return str(getattr(callback, "__qualname__", type(callback).__name__))


def _report_endpoint(kind: str, node: Any, endpoint: Any, **details: Any) -> None:
    if endpoint.topic_name in _TOPICS_OF_RCLPY:
        return
    number = next(_endpoint_numbers)
    _endpoints[id(endpoint)] = number, kind, endpoint.topic_name
    report(
        kind,
        number=number,
        node=_full_name(node),
        topic=endpoint.topic_name,
        type=_type_name(endpoint.msg_type),
        **_qos(endpoint.qos_profile),
        **_place(),
        **details,
    )


def _patch_endpoint(endpoint_class: Any) -> None:
    def destroyed(endpoint: Any) -> None:
        if not _spun:
            # Nothing waits for its work yet, and it may be gone before it is seen.
            flush()
        number, _kind, _topic = _endpoints.pop(id(endpoint))
        report("destroyed", number=number)

    _wrap(endpoint_class, "destroy", before=destroyed)


def _hold(node: Any, publisher: Any) -> None:
    """Wait until a publisher that the probe listens to is matched with another process.

    Only with a node's first one on the topic: a node that makes a new publisher for every
    message loses them.
    """
    key = (_full_name(node), publisher.topic_name)
    if publisher.topic_name not in HELD_TOPICS or key in _held:
        return
    _held.add(key)
    import time

    began_s = time.monotonic()
    # Subscriptions of this process match too, and at once.
    matched_here = sum(
        kind == "subscription" and topic == publisher.topic_name
        for _, kind, topic in _endpoints.values()
    )
    while publisher.get_subscription_count() <= matched_here:
        if time.monotonic() - began_s > _HOLD_LIMIT_S:
            break
        time.sleep(_HOLD_POLL_S)
    _held_publishers.append(publisher)
    report(
        "held",
        topic=publisher.topic_name,
        waited_s=time.monotonic() - began_s,
        matched=publisher.get_subscription_count() > matched_here,
    )


def _report_messages(publisher: Any) -> None:
    """Report of messages 1, 2, 4, 8, ... on a topic of the probe's where they are published."""
    topic, publish = publisher.topic_name, publisher.publish
    if topic not in HELD_TOPICS:
        return

    def reported(*args: Any, **kwargs: Any) -> Any:
        number = _messages.get(topic, 0) + 1
        _messages[topic] = number
        if _is_power_of_two(number):
            report("published", topic=topic, number=number, **_place())
        return publish(*args, **kwargs)

    publisher.publish = reported


def flush() -> None:
    """Let what was published arrive, and what was created be seen, before it goes away.

    Discovery takes a moment: of a process that ends at once, the graph might show the node or
    not, by chance. So it waits until the cell has seen everything that was declared.
    """
    from rclpy.duration import Duration

    while _held_publishers:
        publisher = _held_publishers.pop()
        quietly(publisher.wait_for_all_acked, Duration(seconds=_FLUSH_LIMIT_S))
    if _has_unseen_nodes[0] and pipe_at(SEEN_FD):
        _has_unseen_nodes[0] = False
        report("leaving")
        # The cell closes its end.
        select.select([SEEN_FD], [], [], _SEEN_LIMIT_S)


def _wrap(owner: Any, name: str, before: Any = None, after: Any = None) -> None:
    import functools

    original = getattr(owner, name)

    @functools.wraps(original)
    def wrapped(self: Any, *args: Any, **kwargs: Any) -> Any:
        if before is not None:
            quietly(before, self)
        result = original(self, *args, **kwargs)
        if after is not None:
            quietly(after, self, result)
        return result

    setattr(owner, name, wrapped)


def _patch_node(module: Any) -> None:
    node_class = module.Node

    def made(node: Any, _: Any) -> None:
        _has_unseen_nodes[0] = True
        report("node", node=_full_name(node), **_place())

    def published(node: Any, publisher: Any) -> None:
        _report_endpoint("publisher", node, publisher)
        quietly(_report_messages, publisher)
        _hold(node, publisher)

    def timer_made(node: Any, timer: Any) -> None:
        report(
            "timer",
            node=_full_name(node),
            period_s=timer.timer_period_ns / 1e9,
            callback=_callback_name(timer.callback),
            group=_group(timer.callback_group, node),
            **_place(),
        )

    def subscribed(node: Any, subscription: Any) -> None:
        _report_endpoint(
            "subscription",
            node,
            subscription,
            group=_group(subscription.callback_group, node),
            callback=_callback_name(subscription.callback),
            # One of wait_for_message() is destroyed after the first message.
            brief=sys._getframe(3).f_code.co_name == "wait_for_message",
        )

    _wrap(node_class, "__init__", after=made)
    _wrap(node_class, "create_publisher", after=published)
    _wrap(node_class, "create_subscription", after=subscribed)
    _wrap(node_class, "create_timer", after=timer_made)
    _wrap(node_class, "destroy_node", before=lambda _: flush())


def _freeze(_context: Any) -> None:
    """Spare the garbage collector what was imported: its passes cost a tenth of the CPU time."""
    gc.freeze()
    gc.set_threshold(*THRESHOLDS)


def _patch_context(module: Any) -> None:
    def made(context: Any, _: Any) -> None:
        changed = {name for name in MIDDLEWARE if os.environ.get(name) != MIDDLEWARE[name]}
        changed.update(name for name in middleware_variables() if name not in MIDDLEWARE)
        if str(context.get_domain_id()) != MIDDLEWARE.get("ROS_DOMAIN_ID", "0"):
            changed.add("ROS_DOMAIN_ID")
        report("init", changed=" ".join(sorted(changed)))
        watch()

    _wrap(module.Context, "init", before=_freeze, after=made)
    _wrap(module.Context, "shutdown", before=lambda _: flush())
    _wrap(module.Context, "try_shutdown", before=lambda _: flush())


def _is_paused() -> bool:
    """Whether the cell asks executors to find nothing ready: it writes, and closes its end."""
    events = _pause_poll.poll(0)
    if not events:
        return False
    _, event = events[0]
    return event == select.POLLIN and pipe_at(PAUSE_FD) == PAUSE_PIPE


def _pause(timeout_sec: Any) -> bool:
    """Wait as an executor to which nothing happens; whether its timeout ends before the pause."""
    import time

    if not _has_paused[0]:
        _has_paused[0] = True
        report("paused")
    limit_s = getattr(timeout_sec, "timeout", timeout_sec)
    has_limit = limit_s is not None and limit_s >= 0
    began_s = time.monotonic()
    while _is_paused():
        if has_limit and time.monotonic() - began_s >= limit_s:
            return True
        time.sleep(_PAUSE_POLL_S)
    return False


def _patch_executors(module: Any) -> None:
    executor_class = module.Executor
    wait = executor_class.wait_for_ready_callbacks

    def wait_for_ready_callbacks(self: Any, *args: Any, **kwargs: Any) -> Any:
        if self not in _spun:
            _spun.add(self)
            threads = getattr(getattr(self, "_executor", None), "_max_workers", 1)
            report("spin", executor=type(self).__name__, threads=threads, tells_added=True)
        if _is_paused() and _pause(args[0] if args else kwargs.get("timeout_sec")):
            raise module.TimeoutException
        return wait(self, *args, **kwargs)

    def added(self: Any, _: Any) -> None:
        # rclpy.spin_once(node) adds its node at each call.
        for name in {_full_name(node) for node in self.get_nodes()} - _added:
            _added.add(name)
            report("added", node=name)

    executor_class.wait_for_ready_callbacks = wait_for_ready_callbacks
    _wrap(executor_class, "add_node", after=added)
    _give_threads(module.MultiThreadedExecutor)


def _give_threads(executor_class: Any) -> None:
    make = executor_class.__init__

    def made(self: Any, num_threads: Any = None, **kwargs: Any) -> None:
        if num_threads is None:
            num_threads = max(LEAST_THREADS, len(os.sched_getaffinity(0)))
        make(self, num_threads, **kwargs)
        report("made", executor=type(self).__name__)

    executor_class.__init__ = made


def _patch_callback_groups(module: Any) -> None:
    _time_callbacks(module.MutuallyExclusiveCallbackGroup)
    _time_callbacks(module.ReentrantCallbackGroup)


def _time_callbacks(group_class: Any) -> None:
    """Time the calls of callbacks: executors ask the group before each, and tell it afterwards."""
    import time

    begin, end = group_class.beginning_execution, group_class.ending_execution

    def beginning_execution(group: Any, entity: Any) -> Any:
        may_begin = begin(group, entity)
        if may_begin:
            others, number = len(_running), next(_run_numbers)
            _running.add(number)
            _newest_run[0] = number
            _began.setdefault(id(entity), []).append((time.time_ns(), others, number))
        return may_begin

    def ending_execution(group: Any, entity: Any) -> None:
        quietly(_report_run, group, entity, time.time_ns())
        end(group, entity)

    group_class.beginning_execution = beginning_execution
    group_class.ending_execution = ending_execution


def _report_run(group: Any, entity: Any, ended_ns: int) -> None:
    """Report a call of a timer, a subscription or a service, but for those of rclpy itself."""
    import threading

    began_ns, others_at_begin, run = _began[id(entity)].pop(0)
    _running.discard(run)
    serves = getattr(entity, "topic_name", None) or getattr(entity, "service_name", None)
    if not serves:
        # What is no timer either lacks this, so that nothing is reported.
        serves = f"{entity.timer_period_ns / 1e9:g} s"
    if entity.callback.__module__.startswith("rclpy."):
        return
    is_long = ended_ns - began_ns >= _SHORT_NS
    overlaps = others_at_begin > 0 or _newest_run[0] != run
    number = next(_calls[id(entity), overlaps])
    is_sample = _is_power_of_two(number) or (overlaps and number <= _FIRST_SHORT)
    if (is_long or is_sample) and next(_reported_runs) < _MOST_RUNS:
        report(
            "ran",
            callback=_callback_name(entity.callback),
            serves=serves,
            group=f"{type(group).__name__} {id(group)}",
            thread=threading.get_ident(),
            began_ns=began_ns,
            ended_ns=ended_ns,
        )


def _patch_events_executor(module: Any) -> None:
    make = module.EventsExecutor

    def made(*args: Any, **kwargs: Any) -> Any:
        # It is made in C++ and has no method to wrap.
        report("spin", executor="EventsExecutor", threads=1)
        return make(*args, **kwargs)

    module.EventsExecutor = made
    _wait_in_slices(module._rclpy.EventsExecutor)


def _wait_in_slices(executor_class: Any) -> None:
    """Let it wait in slices: in the wheels a wait without a limit ends at once and calls nothing.

    Between two of them it can pause.
    """
    spin_once = executor_class.spin_once

    def once(self: Any, timeout_sec: Any = None) -> None:
        if _is_paused() and _pause(timeout_sec):
            return
        spin_once(self, _SLICE_S if timeout_sec is None else timeout_sec)

    def spin(self: Any) -> None:
        while self.context.ok():
            once(self)

    executor_class.spin_once = once
    executor_class.spin = spin


PATCHES = {
    "rclpy.callback_groups": _patch_callback_groups,
    "rclpy.experimental.events_executor": _patch_events_executor,
    "rclpy.node": _patch_node,
    "rclpy.publisher": lambda module: _patch_endpoint(module.Publisher),
    "rclpy.subscription": lambda module: _patch_endpoint(module.Subscription),
    "rclpy.context": _patch_context,
    "rclpy.executors": _patch_executors,
}
