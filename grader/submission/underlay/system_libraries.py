"""What packages need of the system, by its rosdep keys (REP-111): Debian's and Ubuntu's names."""

from __future__ import annotations

import importlib.util
import platform
import re
import shutil
import subprocess
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from importlib import metadata
from typing import Any

_LISTED = "${db:Status-Status}\t${Package}, ${Provides}\n"
_ENDINGS = ("-pip", "-modules")
_PYTHON = "python3"


@dataclass(frozen=True)
class System:
    """The Linux distribution, as rosdep names it: ``debian``, ``bookworm``.

    Attributes:
        installed: Its packages that are there; None where it is neither Debian nor Ubuntu, or
            derived from them.
    """

    id: str
    codename: str
    installed: frozenset[str] | None

    def packages(self, rules: Mapping[str, Any]) -> tuple[str, ...]:
        """What apt installs for a rosdep key; nothing where it has nothing for it."""
        rule = rules.get(self.id)
        if isinstance(rule, dict) and not {"apt", "pip"} & rule.keys():
            rule = rule.get(self.codename, rule.get("*"))
        if isinstance(rule, dict):
            rule = rule.get("apt")
        if isinstance(rule, dict):
            rule = rule.get("packages")
        names = rule.split() if isinstance(rule, str) else rule
        return tuple(map(str, names)) if isinstance(names, list) else ()

    def lacking(self, rules: Iterable[Mapping[str, Any]]) -> list[str]:
        """The packages for some rosdep keys that are not installed, as far as that is known."""
        if self.installed is None:
            return []
        wanted = {name for rule in rules for name in self.packages(rule)}
        return sorted(wanted - self.installed)


def this_system() -> System:
    """The system that this program runs on."""
    try:
        release = platform.freedesktop_os_release()
    except OSError:
        release = {}
    names = [release.get("ID", ""), *release.get("ID_LIKE", "").split()]
    name = next((one for one in names if one in ("ubuntu", "debian")), names[0])
    # What is derived from Ubuntu has a codename of its own beside Ubuntu's.
    codename = release.get("UBUNTU_CODENAME") or release.get("VERSION_CODENAME", "")
    return System(name, codename, _installed())


def _installed() -> frozenset[str] | None:
    """The packages that dpkg installed, and what they provide."""
    dpkg = shutil.which("dpkg-query")
    if dpkg is None:
        return None
    command = [dpkg, "--show", f"--showformat={_LISTED}"]
    listed = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    packages = set[str]()
    for line in listed.splitlines():
        status, _, names = line.partition("\t")
        if status == "installed":
            packages.update(re.split(r"[ :]", name.strip())[0] for name in names.split(","))
    return frozenset(packages - {""})


def is_of_python(key: str) -> bool:
    """Whether a rosdep key names Python or a library of it."""
    return key == _PYTHON or key.startswith(f"{_PYTHON}-")


def not_importable(keys: Collection[str]) -> list[str]:
    """Libraries of Python, by their rosdep keys, that this interpreter probably lacks."""
    return sorted(key for key in keys if key != _PYTHON and not _has_library(key))


def _has_library(key: str) -> bool:
    name = key.removeprefix(f"{_PYTHON}-")
    for ending in _ENDINGS:
        name = name.removesuffix(ending)
    try:
        metadata.distribution(name)
    except metadata.PackageNotFoundError:
        return any(map(_is_module, (name.replace("-", "_"), name.replace("-", "."))))
    return True


def _is_module(name: str) -> bool:
    try:
        return importlib.util.find_spec(name) is not None
    except (ImportError, ValueError):
        return False
