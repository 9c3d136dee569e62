"""The tracer: tells the cell what a student's process does that DDS does not carry.

Python imports a module of this name at start, before the student's code. It wraps a few methods
of rclpy once the student imports them, and reports each use as one JSON line on a pipe of the
cell, which Python programs that this one starts get as well. It changes nothing else, with five
exceptions:

- A publisher on a topic that the probe listens to is held until it is matched: a volatile
  publisher that publishes in a constructor otherwise writes before discovery has matched it.
- After the observation executors find nothing ready: what is published then, they did not call.
- A MultiThreadedExecutor that takes as many threads as there are CPUs gets four at least, and
  os.cpu_count() says four at least, because right code would look serial on a small machine.
- `ros2 launch` shows the traceback of a launch file that raises.
- An EventsExecutor of the wheels waits in slices, because without a limit it never calls anything.

Only the standard library may be used here, as little as possible of it, and an error must
never reach the student's program.
"""

from __future__ import annotations

import gc
import os
import sys

from rosgrade_report import (  # type: ignore[import-not-found]
    FD,
    INSTALL,
    LEAST_THREADS,
    PAUSE_FD,
    PIPE,
    SEEN_FD,
    pipe_at,
    quietly,
    report,
)

TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

_IMPORTED = 100_000


def _exit() -> None:
    """Report that Python ends in its usual way: by the program's end or an exception, no signal.

    Where it ends by a field that a message does not have, the fields that it has; where by one that
    holds a value of another type, this one.
    """
    told = {"fields": quietly(_fields), "field": quietly(_unsent)}
    report("exiting", **{name: text for name, text in told.items() if text})
    if "rosgrade_rclpy" in sys.modules:
        quietly(sys.modules["rosgrade_rclpy"].flush)


def _fields() -> str | None:
    """Fields of the message whose attribute was missing; None where no such error ended it."""
    error = getattr(sys, "last_value", None)
    if not isinstance(error, AttributeError):
        return None
    # "'Vector3' object has no attribute 'w'": an error of an assignment does not have the object.
    name = str(error).split("'")[1]
    modules = [module for path, module in sys.modules.items() if path.endswith(".msg")]
    kind = next(getattr(module, name) for module in modules if hasattr(module, name))
    return " ".join(kind.get_fields_and_field_types())


def _unsent() -> str | None:
    """The field, such as ``header.stamp``, for which a message could not be sent, or None."""
    trace: Any = sys.last_traceback
    while trace.tb_next is not None:
        trace = trace.tb_next
    for value in trace.tb_frame.f_locals.values():
        if not isinstance(value, type) and hasattr(value, "get_fields_and_field_types"):
            return _of_other_type(value)
    return None


def _of_other_type(message: Any) -> str | None:
    """The first field of a message that holds no message, or no integer, where it must."""
    for name, kind in message.get_fields_and_field_types().items():
        value = getattr(message, name)
        if kind.lstrip("u").startswith("int") and kind[-1].isdigit():
            if not hasattr(value, "__index__"):
                return str(name)
        elif "/" in kind:
            for one in value if kind[-1] in ">]" else [value]:
                if not hasattr(one, "get_fields_and_field_types"):
                    return str(name)
                if inner := _of_other_type(one):
                    return f"{name}.{inner}"
    return None


def _count_more_cpus() -> None:
    """Let os.cpu_count() and os.process_cpu_count() say four at least."""
    for name in ("cpu_count", "process_cpu_count"):
        if hasattr(os, name):
            setattr(os, name, _at_least_threads(getattr(os, name)))


def _at_least_threads(count: Any) -> Any:
    return _like(count, lambda: max(LEAST_THREADS, count() or 0), "os")


def _like(original: Any, function: Any, module: str) -> Any:
    """Give a function the name of the one that it replaces, by which pickle finds it."""
    function.__name__ = function.__qualname__ = original.__name__
    function.__module__, function.__doc__ = module, original.__doc__
    return function


def _keep_pipes() -> None:
    """Let os.close() and os.closerange() not see the pipes of the cell: daemons close all."""
    close, close_range = os.close, os.closerange
    kept = sorted((FD, SEEN_FD, PAUSE_FD))

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


def _passed() -> tuple[int, ...]:
    """The pipes of the cell that programs which this one starts get as well."""
    return tuple(fd for fd in (FD, PAUSE_FD) if pipe_at(fd))


def _patch_subprocess(module: Any) -> None:
    make = module.Popen.__init__

    def made(self: Any, *args: Any, **kwargs: Any) -> None:
        if kwargs.get("close_fds", True) and pipe_at(FD) == PIPE:
            kwargs["pass_fds"] = (*kwargs.get("pass_fds", ()), *_passed())
        make(self, *args, **kwargs)

    module.Popen.__init__ = made


def _patch_multiprocessing(module: Any) -> None:
    start = module.spawnv_passfds

    def started(path: Any, args: Any, passfds: Any) -> Any:
        return start(path, args, {*passfds, *_passed()} if pipe_at(FD) == PIPE else passfds)

    module.spawnv_passfds = started


def _patch_launch(module: Any) -> None:
    """Show the traceback of a launch file that raises: without --debug, launch keeps it back."""
    traceback = module.traceback

    class Shown:
        @staticmethod
        def format_exc() -> str:
            text: str = traceback.format_exc()
            sys.stderr.write(text)
            return text

    module.traceback = Shown


def _patch_rclpy(module: Any) -> None:
    # By name: it stands on this module.
    __import__("rosgrade_rclpy").PATCHES[module.__name__](module)


_PATCHES = {
    "subprocess": _patch_subprocess,
    "multiprocessing.util": _patch_multiprocessing,
    "launch.launch_service": _patch_launch,
    **dict.fromkeys(
        (
            "rclpy.callback_groups",
            "rclpy.context",
            "rclpy.executors",
            "rclpy.experimental.events_executor",
            "rclpy.node",
            "rclpy.publisher",
            "rclpy.subscription",
        ),
        _patch_rclpy,
    ),
}


class _Finder:
    @classmethod
    def find_spec(cls, name: str, path: Any = None, target: Any = None) -> Any:
        quietly(_note_import, name)
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
            quietly(patch, module)

        return exec_module


def _note_import(name: str) -> None:
    """Report where the student's own code imports what is not of Python, unless it can fail."""
    root = name.partition(".")[0]
    if root in sys.stdlib_module_names or root in _imported or not INSTALL:
        return
    frame = sys._getframe()
    # Of what is executed from a text, the file is that of the code that executes it.
    while _passes_on(frame.f_code.co_filename):
        frame = frame.f_back  # type: ignore[assignment]
    if frame.f_code.co_filename.startswith(f"{INSTALL}/"):
        _imported.add(root)
        if not _is_guarded(frame):
            file = frame.f_code.co_filename
            report("imported", module=root, file=file, line=frame.f_lineno)


def _passes_on(file: str) -> bool:
    own = (__file__, quietly.__code__.co_filename)
    return file in own or file.startswith("<") or "/importlib/" in file


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
        quietly(_note_import, name)
        return import_module(name, package)

    return _like(import_module, imported, "importlib")


_imported = {"rosgrade_rclpy"}


# A child that did not inherit the pipe has the variable, but not what it names.
if PIPE is not None and str(PIPE[1]) == os.environ.get("ROSGRADE_TRACER_PIPE"):
    sys.meta_path.insert(0, _Finder)
    # Imports make objects and no garbage: until rclpy.init() there is little to look for.
    gc.set_threshold(_IMPORTED)
    # It writes code for messages when they are built; rosidl_generator_py does without if it lacks.
    sys.modules["rosidl_generator_py.generate_py_impl"] = None  # type: ignore[assignment]
    _count_more_cpus()
    _keep_pipes()
    import atexit
    import importlib

    importlib.import_module = _importing_module(importlib.import_module)

    atexit.register(_exit)
    report("started", executable=sys.argv[0] if hasattr(sys, "argv") else "")
