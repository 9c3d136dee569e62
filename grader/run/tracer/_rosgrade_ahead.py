"""Imports ahead of a program, which then imports the same in no time and sees no difference.

What was imported ahead cannot be seen until the program imports it. Then Python finds it as it
finds any module, and what its execution did to others is done again: what it imported is
imported, what it registered for the end of the program is registered.

Only the standard library may be used here, and nothing of it before the imports are watched.
"""

from __future__ import annotations

import atexit
import builtins
import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from typing import Any

_STARTED = frozenset(sys.modules)
_bootstrap: Any = sys.modules["_frozen_importlib"]
_PathFinder: Any = sys.modules["_frozen_importlib_external"].PathFinder
_ABSENT = object()


class _Kept:
    """A module that was executed ahead, as the loader of itself."""

    def __init__(self, module: Any, ahead: Ahead) -> None:
        self.module = module
        self._ahead = ahead
        self.spec = module.__spec__
        self.imports: dict[str, None] = {}
        self.at_exit: list[tuple[Any, Any, Any]] = []
        self.children: dict[str, Any] = {}
        self.injected: dict[str, Any] = {}

    def __getattr__(self, name: str) -> Any:
        """What its own loader knows of it, such as its source."""
        return getattr(self.spec.loader, name)

    def create_module(self, _spec: Any) -> Any:
        return self.module

    def exec_module(self, module: Any) -> None:
        """Do to others what the execution of the module did."""
        self._ahead.take(self.spec.name)
        module.__spec__ = self.spec
        sys.modules.update(self.injected)
        for name in self.imports:
            _bootstrap._gcd_import(name)
        for name, value in self.children.items():
            if value is not _ABSENT:
                setattr(module, name, value)
            elif name in vars(module):
                delattr(module, name)
        if not self._ahead.is_loading:
            for function, args, kwargs in self.at_exit:
                atexit.register(function, *args, **kwargs)

    def note_children(self) -> None:
        """Remember what a package calls by the names of modules in it, where it is not these."""
        prefix = f"{self.spec.name}."
        for name in [one for one in sys.modules if one.startswith(prefix)]:
            child = name[len(prefix) :]
            value = vars(self.module).get(child, _ABSENT)
            if "." not in child and value is not sys.modules[name]:
                self.children[child] = value


class Ahead:
    """Imports ahead, and finds what it has imported."""

    def __init__(self) -> None:
        self._kept: dict[str, _Kept] = {}
        self._waiting: dict[str, _Kept] = {}
        self._executing: list[_Kept] = []
        self._path: list[str] = []
        self.is_loading = False

    def be_as_at_the_start(self) -> None:
        """Let the program that begins now find what is kept, as at any start."""
        for finder in sys.meta_path:
            if hasattr(finder, "invalidate_caches"):
                finder.invalidate_caches()
        sys.path_importer_cache.clear()
        self._path = list(sys.path)
        sys.meta_path.insert(0, self)

    @property
    def roots(self) -> frozenset[str]:
        """Names of what is kept, without modules within packages."""
        return frozenset(name.partition(".")[0] for name in self._kept)

    def module(self, name: str) -> Any:
        """One that was imported."""
        return self._kept[name].module if name in self._kept else sys.modules[name]

    def load(self, names: Iterable[str]) -> None:
        """Import modules, and interfaces such as ``std_msgs/msg/String``, those that are there."""
        importing, register = builtins.__import__, atexit.register
        finders = list(sys.meta_path)
        self.is_loading = True
        sys.meta_path[:0] = (_Watch(self), self)
        builtins.__import__ = self._noting(importing)
        atexit.register = self._noting_exit(register)
        try:
            for name in names:
                _import(name)
                # What is not there has to be looked for, which is seen, whoever asks for it.
                self.hide()
        finally:
            self.is_loading = False
            sys.meta_path[:] = finders
            builtins.__import__, atexit.register = importing, register

    def hide(self) -> None:
        """Let nothing of it be seen."""
        ours = {one: sys.modules[one] for one in sys.modules if one not in _STARTED}
        for name, module in ours.items():
            spec = getattr(module, "__spec__", None)
            if name not in self._kept and spec is not None and spec.name == name:
                self._kept[name] = _Kept(module, self)
        for name, module in ours.items():
            package, _, child = name.rpartition(".")
            parent = ours.get(package) or sys.modules.get(package)
            del sys.modules[name]
            if name in self._kept and parent and vars(parent).get(child, _ABSENT) is module:
                delattr(parent, child)
        self._waiting = dict(self._kept)

    def find_spec(self, name: str, path: Any = None, _target: Any = None) -> Any:
        """What was executed ahead, the first time."""
        kept = self._waiting.get(name)
        if kept is None or self._finds_another(kept, path):
            return None
        spec = _bootstrap.ModuleSpec(name, kept)
        vars(spec).update(vars(kept.spec), loader=kept)
        return spec

    def _finds_another(self, kept: _Kept, path: Any) -> bool:
        """Whether the program looks in other folders than at its start, and that is in one."""
        # Before the others stands the folder of the program, which was looked into.
        if self.is_loading or sys.path[1:] == self._path:
            return False
        found = _PathFinder.find_spec(kept.spec.name, path)
        # One that is in no folder is Python's own, if it is not in a package.
        return not _is_same(found.origin, kept.spec.origin) if found else bool(path)

    def take(self, name: str) -> None:
        """It is there now; whoever throws it away and imports it again gets a new one."""
        self._waiting.pop(name, None)

    def be_a_fork(self) -> None:
        """Give a fork an id, a host's name and random numbers of its own, where no module does."""
        if "threading" in self._kept:
            threading = self._kept["threading"].module
            threading.main_thread()._native_id = threading.get_native_id()
        if "platform" in self._kept:
            self._kept["platform"].module._uname_cache = None
        if "numpy.random" in self._kept:
            self._kept["numpy.random"].module.seed()

    def executing(self, module: Any, execute: Callable[[Any], None]) -> None:
        """Execute a module under watch."""
        kept = _Kept(module, self)
        self._executing.append(kept)
        before = set(sys.modules)
        try:
            execute(module)
        finally:
            self._executing.pop()
        kept.note_children()
        for name in set(sys.modules) - before:
            spec = getattr(sys.modules[name], "__spec__", None)
            if spec is None or spec.name != name:
                kept.injected[name] = sys.modules[name]
        self._kept[kept.spec.name] = kept

    def note(self, name: str) -> None:
        """What is executed at the moment has imported a module."""
        if self._executing and name not in _STARTED:
            self._executing[-1].imports[name] = None

    def _noting(self, importing: Any) -> Any:
        def noting(
            name: str, globals: Any = None, locals: Any = None, fromlist: Any = (), level: int = 0
        ) -> Any:
            module = importing(name, globals, locals, fromlist, level)
            if self._executing:
                if level:
                    package = _bootstrap._calc___package__(globals)
                    name = _bootstrap._resolve_name(name, package, level)
                self.note(name)
                for item in fromlist or ():
                    for child in getattr(module, "__all__", ()) if item == "*" else (item,):
                        if f"{name}.{child}" in sys.modules:
                            self.note(f"{name}.{child}")
            return module

        return noting

    def _noting_exit(self, register: Any) -> Any:
        def noting(function: Any, *args: Any, **kwargs: Any) -> Any:
            if not self._executing:
                return register(function, *args, **kwargs)
            self._executing[-1].at_exit.append((function, args, kwargs))
            return function

        return noting


class _Watch:
    """Finds modules as Python does, and watches what their execution does."""

    def __init__(self, ahead: Ahead) -> None:
        self._ahead = ahead

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> Any:
        others: list[Any] = [finder for finder in sys.meta_path if finder is not self]
        for finder in others:
            spec = finder.find_spec(name, path, target)
            if spec is not None:
                self._ahead.note(name)
                if spec.loader is not None and not isinstance(spec.loader, _Kept):
                    spec.loader = _Watched(spec.loader, self._ahead)
                return spec
        return None


class _Watched:
    """The loader of a module that is executed under watch."""

    def __init__(self, loader: Any, ahead: Ahead) -> None:
        self._loader = loader
        self._ahead = ahead

    def create_module(self, spec: Any) -> Any:
        return self._loader.create_module(spec)

    def exec_module(self, module: Any) -> None:
        module.__spec__.loader = module.__loader__ = self._loader
        self._ahead.executing(module, self._loader.exec_module)


def _is_same(origin: Any, kept: Any) -> bool:
    """Whether a module is of the same file, which a link may give another name.

    What was loaded from it cannot always be loaded again: NumPy cannot.
    """
    if origin == kept:
        return True
    try:
        return os.path.samefile(origin, kept)
    except (OSError, TypeError, ValueError):
        return False


def _import(name: str) -> None:
    package, *path = name.split("/")
    try:
        module = _bootstrap._gcd_import(".".join((package, *path[:-1])))
        if path:
            getattr(module, path[-1]).__import_type_support__()
    except Exception:
        # It is not there, and the program that needs it is told so.
        return
