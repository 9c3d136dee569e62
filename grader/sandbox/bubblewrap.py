"""Command lines of bubblewrap: what a process sees, and how little.

bubblewrap never runs as root: it could not mount /proc below itself, the limit of processes
would not hold, and files that only root may read would be readable. As root the folders to show
are bound to a place that every user can reach, in a mount namespace of the command's own, and
the command goes on as a user that owns nothing.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import shutil
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

UID = 61_000
"""The user that sandboxes run as where rosgrade runs as root; a free one (systemd, UIDs-GIDs)."""
_BUILD_UIDS = 100
_BUILDS = itertools.count()
"""Each build runs as another user, for the kernel counts by user (see `grader.sandbox.limits`)."""
PLAIN_ENVIRONMENT = {"PATH": "/usr/sbin:/usr/bin:/sbin:/bin"}
"""Environment of bubblewrap itself, which every process inside can read."""

_STAGE = "/run/rosgrade"
_FILTER_FD = 9
_STAGING = """\
set -e
context=$1; shift
mkdir -p -m 755 "$context"
mount -t tmpfs -o mode=755,size=1m rosgrade "$context"
n=0
while [ "$1" != -- ]; do
  if [ -d "$1" ]; then mkdir "$context/$n"; else : > "$context/$n"; fi
  mount --rbind "$1" "$context/$n"
  n=$((n + 1)); shift
done
shift
exec "$@"
"""
HIDDEN_INIT = ("--tmpfs", "/proc/1", "--remount-ro", "/proc/1")
"""Nothing inside reaches the memory of the sandbox's first process, which is bubblewrap's own."""
_NAMESPACES = ("--unshare-user", "--unshare-pid", "--unshare-ipc", "--unshare-uts")
_SYSTEM_FOLDERS = ("bin", "sbin", "lib", "lib32", "lib64", "libx32")
_LINKS = "/etc/alternatives"
_SYSTEM_FILES = ("/etc/ld.so.cache", "/etc/localtime")


@dataclass(frozen=True)
class Bind:
    """A folder or file that is seen inside.

    Attributes:
        target: Inside; absolute.
    """

    source: Path
    target: Path
    writable: bool = False

    @classmethod
    def same(cls, path: Path, *, writable: bool = False) -> Bind:
        """A folder or file at the same path as outside."""
        return cls(path, path, writable)


def namespaces(uid: int, *, network: bool = True) -> list[str]:
    """New namespaces, with a user of no rights in them."""
    own = [*_NAMESPACES, "--unshare-cgroup-try", *(["--unshare-net"] if network else [])]
    return [*own, "--uid", str(uid), "--gid", str(uid), "--new-session"]


def system(copies: Path | None = None) -> list[str]:
    """The system's programs and libraries, read-only, and an empty /proc, /dev and /tmp.

    Args:
        copies: Where :func:`copy_system_files` left the files, as bubblewrap will see it; by
            default the files themselves are shown.
    """
    arguments = ["--ro-bind", "/usr", "/usr"]
    for name in _SYSTEM_FOLDERS:
        path = Path("/", name)
        if path.is_symlink():
            arguments += ["--symlink", str(path.readlink()), str(path)]
        elif path.is_dir():
            arguments += ["--ro-bind", str(path), str(path)]
    if Path(_LINKS).is_dir():
        arguments += ["--ro-bind", _LINKS, _LINKS]
    for file in _system_files():
        source = file if copies is None else copies / file.relative_to("/")
        arguments += ["--ro-bind", str(source), str(file)]
    return [*arguments, "--proc", "/proc", "--dev", "/dev"]


def copy_system_files(folder: Path) -> None:
    """Copy the files that :func:`system` shows, for a sandbox within a sandbox.

    A file that was replaced meanwhile, as the installation of a package does, can no longer be
    bound from within a sandbox.
    """
    for file in _system_files():
        copy = folder / file.relative_to("/")
        copy.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, copy)


def _system_files() -> list[Path]:
    return [file for file in map(Path, _SYSTEM_FILES) if file.exists()]


def variables(environment: Mapping[str, str]) -> list[str]:
    """Exactly these variables."""
    arguments = ["--clearenv"]
    for name, value in environment.items():
        arguments += ["--setenv", name, value]
    return arguments


def bound(binds: Iterable[Bind]) -> list[str]:
    """Arguments that show folders and files."""
    arguments: list[str] = []
    for bind in binds:
        how = "--bind" if bind.writable else "--ro-bind"
        arguments += [how, str(bind.source), str(bind.target)]
    return arguments


def launch(
    arguments: Sequence[str],
    binds: Sequence[Bind],
    last: Sequence[str],
    command: Sequence[str],
    filter_file: Path | None = None,
    uid: int = UID,
) -> list[str]:
    """The whole command line that starts a sandbox from outside of any.

    Args:
        arguments: Of bubblewrap; what they bind every user may read.
        filter_file: Filter of system calls, or None.
    """
    program = [str(shutil.which("bwrap"))]
    opened: list[str] = []
    if filter_file is not None:
        # Opened before the rights to read it are dropped.
        opened = ["/bin/sh", "-c", f'exec {_FILTER_FD}<"$1"; shift; exec "$@"', "sh"]
        opened.append(str(filter_file))
        last = [*last, "--seccomp", str(_FILTER_FD)]
    if os.geteuid() != 0:
        return [*opened, *program, *arguments, *bound(binds), *last, "--", *command]
    staged = [
        Bind(Path(_STAGE, str(number)), bind.target, bind.writable)
        for number, bind in enumerate(binds)
    ]
    sources = [str(bind.source) for bind in binds]
    return [
        *opened,
        *("unshare", "--mount", "--propagation", "private"),
        *("/bin/sh", "-c", _STAGING, "sh", _STAGE, *sources, "--"),
        *("setpriv", f"--reuid={uid}", f"--regid={uid}", "--clear-groups"),
        *("--inh-caps=-all", "--bounding-set=-all", "--no-new-privs"),
        *(*program, *arguments, *bound(staged), *last, "--", *command),
    ]


def build_uid() -> int:
    """A user that hardly any other sandbox runs as at the moment, where rosgrade runs as root."""
    # The workers of a class are processes of their own, which all begin to count at 0.
    return UID + 1 + (os.getpid() + next(_BUILDS)) % _BUILD_UIDS


def give(path: Path, uid: int = UID) -> None:
    """Make a folder with all that is in it the sandbox's own, so that it can write there."""
    if os.geteuid() == 0:
        _chown(path, uid)


def take_back(path: Path) -> None:
    """Take back the files that a sandbox wrote, and make them readable for the next one."""
    if os.geteuid() == 0:
        _chown(path, 0)


def _chown(path: Path, uid: int) -> None:
    for parent, folders, names in os.walk(path):
        for name in ("", *folders, *names):
            # The cache may be emptied meanwhile; that is found where it matters.
            with contextlib.suppress(FileNotFoundError):
                os.chown(os.path.join(parent, name), uid, uid, follow_symlinks=False)  # noqa: PTH118
