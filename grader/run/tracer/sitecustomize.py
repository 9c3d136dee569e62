"""The tracer: tells the cell what a student's process does that DDS does not carry.

Python imports a module of this name at start, before the student's code. It wraps a few
methods of rclpy when (and only if) the student imports them, reports each use as one JSON
line on the pipe that the cell left open, which Python programs that this one starts get as
well and os.close() does not see, and changes nothing else, with three exceptions. A
publisher on a topic that the probe listens to is held until it is matched, because a
volatile publisher that publishes in a constructor otherwise writes before discovery has
matched anybody, and the message is lost. And a MultiThreadedExecutor that takes as many
threads as there are CPUs gets four at least, because right code would look serial on a small
machine of ours; a number of threads that the program names stays as it is, but os.cpu_count()
says four at least as well, for a program may hand its answer to the executor. And an
EventsExecutor of the wheels waits in slices, because without a limit it never calls anything
there.

Only the standard library may be used here, as little as possible of it, and an error must
never reach the student's program.
"""

from __future__ import annotations

import gc
import itertools
import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

_FD = int(os.environ.get("ROSGRADE_TRACER_FD", "-1"))
_SEEN_FD = int(os.environ.get("ROSGRADE_SEEN_FD", "-1"))
_HELD_TOPICS = frozenset(filter(None, os.environ.get("ROSGRADE_HOLD", "").split(":")))
_HOLD_LIMIT_S = 2.0
_HOLD_POLL_S = 0.002
_FLUSH_LIMIT_S = 0.5
_SEEN_LIMIT_S = 2.0
_LEAST_THREADS = 4
_SLICE_S = 0.5
_THRESHOLDS = gc.get_threshold()
_IMPORTED = 100_000
_PREFIXES = ("ROS_", "RMW_", "FASTDDS_", "FASTRTPS_", "CYCLONEDDS_")
_HARMLESS = ("ROS_LOG_DIR", "ROS_HOME", "ROS_DISTRO", "ROS_VERSION", "ROS_PYTHON_VERSION")
_OWN_TOPICS = ("/parameter_events", "/rosout")
# Writes up to PIPE_BUF (4096 bytes) are atomic, so lines of several processes do not mix.
_LONGEST_LINE = 4000


def _pipe(fd: int) -> tuple[int, int] | None:
    """Identity of a pipe, None for anything else."""
    try:
        status = os.fstat(fd)
    except OSError:
        return None
    return (status.st_dev, status.st_ino) if status.st_mode & 0o170000 == 0o010000 else None


def _report(kind: str, **data: Any) -> None:
    """Send one line to the cell; without a listener nothing happens."""
    try:
        import json

        line = json.dumps({"kind": kind, "pid": os.getpid(), **data}) + "\n"
        # The program may have closed the pipe, and something else may have its number now.
        if len(line) <= _LONGEST_LINE and _PIPE and _pipe(_FD) == _PIPE:
            os.write(_FD, line.encode())
    except Exception:
        pass


def _quietly(function: Any, *args: Any) -> Any:
    try:
        return function(*args)
    except Exception:
        return None


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


def _callback_name(callback: Any) -> str:
    return str(getattr(callback, "__qualname__", type(callback).__name__))


def _group(group: Any, node: Any) -> dict[str, Any]:
    chosen = group if group is not None else node.default_callback_group
    return {"type": type(chosen).__name__, "id": id(chosen)}


def _endpoint(kind: str, node: Any, endpoint: Any, **more: Any) -> None:
    if endpoint.topic_name in _OWN_TOPICS:
        return
    number = next(_count)
    _endpoints[id(endpoint)] = number, kind, endpoint.topic_name
    _report(
        kind,
        number=number,
        node=_full_name(node),
        topic=endpoint.topic_name,
        type=_type_name(endpoint.msg_type),
        **_qos(endpoint.qos_profile),
        **more,
    )


def _patch_endpoint(endpoint_class: Any) -> None:
    def destroyed(endpoint: Any) -> None:
        number, _kind, _topic = _endpoints.pop(id(endpoint))
        _report("destroyed", number=number)

    _wrap(endpoint_class, "destroy", before=destroyed)


def _hold(node: Any, publisher: Any) -> None:
    """Wait until a publisher that the probe listens to is matched with another process.

    Only with a node's first one on the topic: a node that makes a new publisher for every
    message loses them, and that is for the judge to see.
    """
    key = (_full_name(node), publisher.topic_name)
    if publisher.topic_name not in _HELD_TOPICS or key in _held:
        return
    _held.add(key)
    import time

    began = time.monotonic()
    own = sum(item[1:] == ("subscription", publisher.topic_name) for item in _endpoints.values())
    while publisher.get_subscription_count() <= own:
        if time.monotonic() - began > _HOLD_LIMIT_S:
            break
        time.sleep(_HOLD_POLL_S)
    _publishers.append(publisher)
    _report(
        "held",
        topic=publisher.topic_name,
        waited_s=time.monotonic() - began,
        matched=publisher.get_subscription_count() > own,
    )


def _tell_of_messages(publisher: Any) -> None:
    """Report of messages 1, 2, 4, 8, ... on a topic of the probe's where they are published."""
    topic, publish = publisher.topic_name, publisher.publish
    if topic not in _HELD_TOPICS:
        return

    def told(*args: Any, **kwargs: Any) -> Any:
        number = _messages[topic] = _messages.get(topic, 0) + 1
        if not number & (number - 1):
            _report("published", topic=topic, number=number, in_callback=_is_in_callback())
        return publish(*args, **kwargs)

    publisher.publish = told


def _is_in_callback() -> bool:
    """Whether an executor has called what runs now."""
    frame = sys._getframe()
    while frame is not None:
        if frame.f_code.co_filename.endswith(("/rclpy/executors.py", "/rclpy/task.py")):
            return True
        frame = frame.f_back  # type: ignore[assignment]
    return False


_messages: dict[str, int] = {}
_endpoints: dict[int, tuple[int, str, str]] = {}
"""Publishers and subscriptions that are not destroyed: id -> number of the report, kind, topic."""
_count = itertools.count()
_publishers: list[Any] = []
_held: set[tuple[str, str]] = set()
_added: set[str] = set()
_nodes: list[bool] = []


def _flush() -> None:
    """Let what was published arrive, and what was created be seen, before it goes away.

    Discovery takes a moment: of a process that ends at once, the graph might show the node or
    not, by chance. So it waits until the cell says that it has seen everything declared.
    """
    from rclpy.duration import Duration

    while _publishers:
        publisher = _publishers.pop()
        _quietly(publisher.wait_for_all_acked, Duration(seconds=_FLUSH_LIMIT_S))
    if _nodes and _pipe(_SEEN_FD):
        import select

        _nodes.clear()
        _report("leaving")
        # The cell closes its end.
        select.select([_SEEN_FD], [], [], _SEEN_LIMIT_S)


def _exit() -> None:
    """Python ends in its usual way: by the end of the program or an exception, no signal."""
    _report("exiting")
    if "rclpy" in sys.modules:
        _quietly(_flush)


def _wrap(owner: Any, name: str, before: Any = None, after: Any = None) -> None:
    """Replace a method by one that calls ``before(self)`` and ``after(self, result)``."""
    import functools

    original = getattr(owner, name)

    @functools.wraps(original)
    def wrapped(self: Any, *args: Any, **kwargs: Any) -> Any:
        if before is not None:
            _quietly(before, self)
        result = original(self, *args, **kwargs)
        if after is not None:
            _quietly(after, self, result)
        return result

    setattr(owner, name, wrapped)


def _patch_node(module: Any) -> None:
    node_class = module.Node

    def made(node: Any, _: Any) -> None:
        _nodes.append(True)
        _report("node", node=_full_name(node))

    def published(node: Any, publisher: Any) -> None:
        _endpoint("publisher", node, publisher)
        _quietly(_tell_of_messages, publisher)
        _hold(node, publisher)

    def timer_made(node: Any, timer: Any) -> None:
        _report(
            "timer",
            node=_full_name(node),
            period_s=timer.timer_period_ns / 1e9,
            callback=_callback_name(timer.callback),
            group=_group(timer.callback_group, node),
        )

    def subscribed(node: Any, subscription: Any) -> None:
        group = _group(subscription.callback_group, node)
        _endpoint("subscription", node, subscription, group=group)

    _wrap(node_class, "__init__", after=made)
    _wrap(node_class, "create_publisher", after=published)
    _wrap(node_class, "create_subscription", after=subscribed)
    _wrap(node_class, "create_timer", after=timer_made)
    _wrap(node_class, "destroy_node", before=lambda _: _flush())


def _freeze(_context: Any) -> None:
    """Spare the collector what was imported; its passes at exit are a tenth of the CPU time."""
    gc.freeze()
    gc.set_threshold(*_THRESHOLDS)


def _patch_context(module: Any) -> None:
    def made(context: Any, _: Any) -> None:
        changed = {name for name in _MIDDLEWARE if os.environ.get(name) != _MIDDLEWARE[name]}
        changed.update(name for name in _of_middleware() if name not in _MIDDLEWARE)
        if str(context.get_domain_id()) != _MIDDLEWARE.get("ROS_DOMAIN_ID", "0"):
            changed.add("ROS_DOMAIN_ID")
        _report("init", changed=" ".join(sorted(changed)))

    _wrap(module.Context, "init", before=_freeze, after=made)
    _wrap(module.Context, "shutdown", before=lambda _: _flush())
    _wrap(module.Context, "try_shutdown", before=lambda _: _flush())


def _patch_executors(module: Any) -> None:
    executor_class = module.Executor
    original = executor_class.wait_for_ready_callbacks

    def first_wait(self: Any, *args: Any, **kwargs: Any) -> Any:
        # From the second call on the executor runs rclpy's own method again.
        self.wait_for_ready_callbacks = original.__get__(self)
        threads = getattr(getattr(self, "_executor", None), "_max_workers", 1)
        _report("spin", executor=type(self).__name__, threads=threads, tells_added=True)
        return original(self, *args, **kwargs)

    def added(self: Any, _: Any) -> None:
        # rclpy.spin_once(node) adds its node at each call.
        for name in {_full_name(node) for node in self.get_nodes()} - _added:
            _added.add(name)
            _report("added", node=name)

    executor_class.wait_for_ready_callbacks = first_wait
    _wrap(executor_class, "add_node", after=added)
    _give_threads(module.MultiThreadedExecutor)


def _give_threads(executor_class: Any) -> None:
    import functools

    make = executor_class.__init__

    @functools.wraps(make)
    def made(self: Any, num_threads: Any = None, **kwargs: Any) -> None:
        if num_threads is None:
            num_threads = max(_LEAST_THREADS, len(os.sched_getaffinity(0)))
        make(self, num_threads, **kwargs)

    executor_class.__init__ = made


def _count_more_cpus() -> None:
    """Let the ways to ask for the number of CPUs, except which ones they are, say four at least."""
    for name in ("cpu_count", "process_cpu_count"):
        if hasattr(os, name):
            setattr(os, name, _at_least_threads(getattr(os, name)))


def _at_least_threads(count: Any) -> Any:
    def counted() -> int:
        return max(_LEAST_THREADS, count() or 0)

    counted.__name__ = counted.__qualname__ = count.__name__
    # Where to find it, for whoever gives it to another process to call.
    counted.__module__ = "os"
    counted.__doc__ = count.__doc__
    return counted


def _patch_events_executor(module: Any) -> None:
    make = module.EventsExecutor

    def made(*args: Any, **kwargs: Any) -> Any:
        # It is made in C++ and has no method to wrap; who makes one means to spin it.
        _report("spin", executor="EventsExecutor", threads=1)
        return make(*args, **kwargs)

    module.EventsExecutor = made
    if os.environ.get("_ROS_WHEELS_BOOTSTRAP_COMPLETE"):
        _wait_in_slices(module._rclpy.EventsExecutor)


def _wait_in_slices(executor_class: Any) -> None:
    """Repair the wheels' EventsExecutor, whose waits without a limit end at once, again and again.

    It waits until the latest time that there is, and the standard library of C++ that the wheels
    were built with makes one of it that is over. A wait with a limit is right.
    """
    spin_once = executor_class.spin_once

    def once(self: Any, timeout_sec: Any = None) -> None:
        spin_once(self, _SLICE_S if timeout_sec is None else timeout_sec)

    def spin(self: Any) -> None:
        while self.context.ok():
            once(self)

    executor_class.spin_once = once
    executor_class.spin = spin


def _keep_pipes() -> None:
    """Let os.close() and os.closerange() not see the pipes of the cell.

    Programs close all that they did not open, such as daemons.
    """
    close, close_range = os.close, os.closerange
    kept = sorted((_FD, _SEEN_FD))

    def close_other(fd: int) -> None:
        if fd in kept:
            raise OSError(9, "Bad file descriptor")
        close(fd)

    def close_others(low: int, high: int, /) -> None:
        for fd in kept:
            if low <= fd < high:
                close_range(low, fd)
                low = fd + 1
        close_range(low, high)

    # A class that keeps one of them as its own makes no method of it.
    os.close, os.closerange = staticmethod(close_other), staticmethod(close_others)


def _patch_subprocess(module: Any) -> None:
    make = module.Popen.__init__

    def made(self: Any, *args: Any, **kwargs: Any) -> None:
        if kwargs.get("close_fds", True) and _pipe(_FD) == _PIPE:
            kwargs["pass_fds"] = (*kwargs.get("pass_fds", ()), _FD)
        make(self, *args, **kwargs)

    module.Popen.__init__ = made


def _patch_multiprocessing(module: Any) -> None:
    start = module.spawnv_passfds

    def started(path: Any, args: Any, passfds: Any) -> Any:
        return start(path, args, {*passfds, _FD} if _pipe(_FD) == _PIPE else passfds)

    module.spawnv_passfds = started


_PATCHES = {
    "subprocess": _patch_subprocess,
    "multiprocessing.util": _patch_multiprocessing,
    "rclpy.experimental.events_executor": _patch_events_executor,
    "rclpy.node": _patch_node,
    "rclpy.publisher": lambda module: _patch_endpoint(module.Publisher),
    "rclpy.subscription": lambda module: _patch_endpoint(module.Subscription),
    "rclpy.context": _patch_context,
    "rclpy.executors": _patch_executors,
}


class _Finder:
    """Finds the modules to patch as Python would, and patches them once they are loaded."""

    @classmethod
    def find_spec(cls, name: str, path: Any = None, target: Any = None) -> Any:
        _quietly(_note_import, name)
        patch = _PATCHES.get(name)
        if patch is None:
            return None
        others: list[Any] = [finder for finder in sys.meta_path if finder is not cls]
        for finder in others:
            spec = finder.find_spec(name, path, target)
            if spec is not None:
                spec.loader.exec_module = cls._patching(spec.loader.exec_module, patch)
                return spec
        return None

    @staticmethod
    def _patching(execute: Any, patch: Any) -> Any:
        def exec_module(module: Any) -> None:
            execute(module)
            _quietly(patch, module)

        return exec_module


def _note_import(name: str) -> None:
    """Report where the student's own code imports what is not of Python, unless it can fail."""
    root = name.partition(".")[0]
    if root in sys.stdlib_module_names or root in _imported or not _INSTALL:
        return
    frame = sys._getframe()
    # Of what is executed from a text, the file is that of the code that executes it.
    while _passes_on(frame.f_code.co_filename):
        frame = frame.f_back  # type: ignore[assignment]
    if frame.f_code.co_filename.startswith(f"{_INSTALL}/"):
        _imported.add(root)
        if not _is_guarded(frame):
            file = frame.f_code.co_filename
            _report("imported", module=root, file=file, line=frame.f_lineno)


def _passes_on(file: str) -> bool:
    return file == __file__ or file.startswith("<") or "/importlib/" in file


def _is_guarded(frame: Any) -> bool:
    """Whether what a frame executes stands in a `try` or a `with`."""
    import ast

    with open(frame.f_code.co_filename, "rb") as file:
        nodes = ast.walk(ast.parse(file.read()))
    kinds = (ast.Try, getattr(ast, "TryStar", ast.Try), ast.With, ast.AsyncWith)
    guards = (node for node in nodes if isinstance(node, kinds))
    return any(node.lineno <= frame.f_lineno <= (node.end_lineno or 0) for node in guards)


def _importing_module(import_module: Any) -> Any:
    def imported(name: str, package: Any = None) -> Any:
        # What is loaded already is not looked for.
        _quietly(_note_import, name)
        return import_module(name, package)

    imported.__name__ = imported.__qualname__ = import_module.__name__
    imported.__module__, imported.__doc__ = "importlib", import_module.__doc__
    return imported


_imported: set[str] = set()
# As ROS installs programs: PREFIX/lib/PACKAGE/PROGRAM.
_INSTALL = os.path.dirname(os.path.dirname(os.path.dirname("".join(sys.orig_argv[1:2]))))


def _run_hidden_sitecustomize() -> None:
    """Run the sitecustomize that this one hides, as Python would have."""
    here = os.path.dirname(os.path.abspath(__file__))
    paths = [path for path in sys.path if os.path.abspath(path or ".") != here]
    others: list[Any] = [finder for finder in sys.meta_path if finder is not _Finder]
    for finder in others:
        spec = finder.find_spec("sitecustomize", paths)
        if spec is not None and spec.origin and os.path.dirname(spec.origin) != here:
            import importlib.util

            module = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(module)
            return


def _of_middleware() -> dict[str, str]:
    """Variables of the environment that decide with whom a node meets."""
    found = {name: os.environ[name] for name in os.environ if name.startswith(_PREFIXES)}
    return {name: value for name, value in found.items() if name not in _HARMLESS}


_MIDDLEWARE = _of_middleware()
_PIPE = _pipe(_FD)
# A child that did not inherit the pipe has the variable, but not what it names.
if _PIPE is not None and str(_PIPE[1]) == os.environ.get("ROSGRADE_TRACER_PIPE"):
    sys.meta_path.insert(0, _Finder)
    # Imports make objects and no garbage: until rclpy.init() there is little to look for.
    gc.set_threshold(_IMPORTED)
    _count_more_cpus()
    _keep_pipes()
    import atexit
    import importlib

    importlib.import_module = _importing_module(importlib.import_module)

    atexit.register(_exit)
    _report("started", executable=sys.argv[0] if hasattr(sys, "argv") else "")
_quietly(_run_hidden_sitecustomize)
