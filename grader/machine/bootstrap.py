"""Make rosgrade's environment: `python3 -m grader.machine.bootstrap`, or `setup.sh` in a kit.

Runs on the machine's own python3 before anything is installed, so it uses only the standard
library and syntax that any python3 parses: one that is too old still says what to install.
"""

import fcntl
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from contextlib import contextmanager
from pathlib import Path
from typing import (
    Callable,
    Dict,
    Iterable,
    Iterator,
    List,
    Mapping,
    NamedTuple,
    Optional,
    Set,
    Tuple,
)

Version = Tuple[int, int]
OnLine = Callable[[str], object]

DISTRO = "jazzy"
_JAZZY = f"ROS 2 {DISTRO.title()}"
SUPPORTED = ((3, 13), (3, 12), (3, 11), (3, 10))
"""The Pythons that there are wheels of ROS for, the preferred first."""
_PYTHON_OF_JAZZY = (3, 12)
WHEELS_PLATFORM = "linux-x86_64"
VENV = ".venv"
STAMP = "rosgrade-setup.json"
UNDERLAYS_FILE, UNDERLAYS_PLACE = "underlays.tar.gz", "underlays.txt"
"""What `rosgrade underlay export` wrote, or a file with its address, beside the lock."""

COMPILERS = {"cmake": "cmake", "c++": "g++", "make": "make"}
"""What a package needs that is not pure Python -> what it is called by Debian and Ubuntu."""
_PROGRAMS = {**COMPILERS, "bwrap": "bubblewrap", "git": "git"}
_PARTS_OF_PYTHON = {
    "dev": "import os, sysconfig; os.stat(os.path.join(sysconfig.get_path('include'), 'Python.h'))",
    "venv": "import ensurepip, venv",
}
APT = " ".join([*sorted(_PROGRAMS.values()), *("python3-" + part for part in _PARTS_OF_PYTHON)])
"""All that rosgrade takes from the system, for `sudo apt install`."""

# ROS's extensions are built against the system's numpy 1, which numpy 2 breaks, and its message
# generators are written for the system's empy and lark.
_FROM_SYSTEM = {"numpy", "empy", "lark-parser"}
# One package of the lock has no wheel and is built by these, so they are installed before it.
_BUILD_TOOLS = {"setuptools"}
_MARK, _ERROR_MARK = "rosgrade: ", "rosgrade: error: "
_PACKAGES_PER_LINE = 20
"""Packages between two lines of progress."""


class SetupError(Exception):
    """A problem that the user can solve; the text says how."""


class Interpreter(NamedTuple):
    """A Python of this machine."""

    version: Version
    path: str


class Plan(NamedTuple):
    """What environment is made: with the `wheels` of ROS, or the `system`'s, which was sourced."""

    ros: str
    interpreter: Interpreter


class Locked(NamedTuple):
    """One entry of the lock, with the names of the entries that need it."""

    name: str
    text: str
    parents: Set[str]


def plan(
    environ: Mapping[str, str],
    interpreters: Iterable[Interpreter],
    platform: str,
    ros_python: Optional[Version] = None,
) -> Plan:
    """Decide whose ROS is used, and which Python.

    Args:
        interpreters: The Pythons of the machine, the preferred first; read only as far as needed.
        ros_python: The Python version that the sourced ROS was built for, or None.
    """
    distro = _sourced(environ)
    refusal = _refusal(distro, platform, ros_python)
    if refusal:
        raise SetupError(refusal)
    usable = (ros_python,) if distro else SUPPORTED
    unusable: List[str] = []
    for interpreter in interpreters:
        if interpreter.version in usable:
            return Plan("system" if distro else "wheels", interpreter)
        unusable.append(_dotted(interpreter.version))
    advised = ros_python or _PYTHON_OF_JAZZY
    raise SetupError(
        f"rosgrade needs Python {_dotted(advised) if distro else _supported()} and here is only "
        f"{', '.join(unusable) or 'none'}: sudo apt install python{_dotted(advised)}-venv"
    )


def _refusal(distro: str, platform: str, ros_python: Optional[Version]) -> str:
    """Why no Python of this machine could help, in words for the user; empty if one may."""
    if distro and distro != DISTRO:
        return (
            f"ROS 2 {distro.title()} is sourced in this shell and rosgrade is for {_JAZZY}: use a "
            f"shell that sources nothing (rosgrade then installs its own ROS) or {_JAZZY}"
        )
    if distro and ros_python not in SUPPORTED:
        return (
            f"{_JAZZY} is sourced in this shell but holds no rclpy for Python {_supported()}: use "
            f"a shell that sources nothing, or sudo apt install ros-{DISTRO}-rclpy "
            f"ros-{DISTRO}-common-interfaces"
        )
    if not distro and platform != WHEELS_PLATFORM:
        return (
            f"{_JAZZY} comes as wheels for {WHEELS_PLATFORM} only and this is {platform}: source "
            f"{_JAZZY} and try again, or use a container that has it, such as ros:{DISTRO}"
        )
    return ""


def read_lock(lock_text: str) -> List[Locked]:
    """Split a lock of `uv pip compile` into its entries, in their order."""
    entries = []
    for text in re.split(r"\n(?=[A-Za-z0-9])", lock_text.strip("\n")):
        name = re.match(r"[A-Za-z0-9._-]+", text)
        if name:
            via = text.partition("# via")[2].replace("#", "").splitlines()
            parents = {parent.strip() for parent in via if parent.strip()}
            entries.append(Locked(name.group(), text + "\n", parents))
    return entries


def requirements(lock_text: str, chosen: Plan) -> str:
    """Return the part of the lock that is installed under a plan.

    With the system's ROS that is all but the ROS wheels and what the system's ROS was made for.
    """
    return "".join(
        entry.text
        for entry in read_lock(lock_text)
        if chosen.ros == "wheels"
        or not (entry.name.startswith("ros-") or entry.name in _FROM_SYSTEM)
    )


def find_ros_python(ament_prefix_path: str) -> Optional[Version]:
    """Return the Python version that the sourced rclpy was built for, None without an rclpy."""
    for prefix in _prefixes(ament_prefix_path):
        for rclpy in sorted(prefix.glob("lib/python3.*/*-packages/rclpy")):
            version = re.fullmatch(r"python3\.(\d+)", rclpy.parent.parent.name)
            if version:
                return 3, int(version.group(1))
    return None


def find_interpreters(environ: Mapping[str, str]) -> Iterator[Interpreter]:
    """Yield the Pythons of this machine, the preferred first."""
    names = [f"python{_dotted(version)}" for version in SUPPORTED]
    if _sourced(environ):
        # The Python that ROS came with has its numpy and yaml; another of that version has not.
        folders = [str(prefix / "bin") for prefix in _prefixes(environ["AMENT_PREFIX_PATH"])]
        for folder in [*folders, "/usr/bin"]:
            for name in names:
                yield from _interpreter(shutil.which(name, path=folder))
    yield from _interpreter(sys.executable)
    for name in names:
        yield from _interpreter(shutil.which(name))


def set_up(root: Path, environ: Mapping[str, str]) -> None:
    """Bring the environment in `root` up to date; quick when it already is.

    Nothing half-made is left, only perhaps a whole environment that waits for rosgrade itself.

    Args:
        root: A checkout, or a course kit, which has a wheel of rosgrade in the place of sources.
    """
    lock_text = (root / "requirements.lock").read_text(encoding="utf-8")
    chosen = plan(
        environ,
        find_interpreters(environ),
        sysconfig.get_platform(),
        find_ros_python(environ.get("AMENT_PREFIX_PATH", "")),
    )
    is_kit = not (root / "pyproject.toml").exists()
    source = newest_wheel(root) if is_kit else root / "pyproject.toml"
    wanted = {
        # A virtual environment does not survive being moved.
        "root": str(root),
        "ros": chosen.ros,
        "python": _dotted(chosen.interpreter.version),
        "lock": hashlib.sha256(lock_text.encode()).hexdigest(),
        "pyproject": hashlib.sha256(source.read_bytes()).hexdigest(),
    }
    venv = root / VENV
    with _alone(root):
        installed = _read_stamp(venv)
        if installed == wanted:
            _import_underlays(root, environ)
            return
        if venv.is_symlink() or (venv.exists() and not (venv / "pyvenv.cfg").is_file()):
            raise SetupError(f"{venv} is not a virtual environment: move it away")
        # A sandbox runs as another user where rosgrade runs as root; there is no secret in it.
        os.umask(0o022)
        lacks = lacking(chosen.interpreter)
        if _without_rosgrade(installed) != _without_rosgrade(wanted):
            if any(package.endswith("-venv") for package in lacks):
                raise SetupError(
                    f"rosgrade needs Python's venv: sudo apt install {' '.join(lacks)}"
                )
            _make_environment(venv, chosen, lock_text, environ)
        # Only now, so that an interrupted set-up is not taken for a finished one.
        _write_stamp(venv, _without_rosgrade(wanted))
        _say("installing rosgrade itself")
        itself = ["--force-reinstall", str(source)] if is_kit else ["--editable", str(root)]
        options = ["--no-deps", "--no-build-isolation", *itself]
        _pip(venv, options, "rosgrade itself could not be installed")
        _write_stamp(venv, wanted)
        _import_underlays(root, environ)
        if chosen.ros == "wheels":
            _add_ros2(venv, environ)
    if lacks:
        purpose = "for the sandbox and for packages that are compiled"
        _say(f"not here, {purpose}: sudo apt install {' '.join(lacks)}")
    if not is_kit:
        _say(f"ready: {VENV}/bin/rosgrade --help")


def newest_wheel(kit: Path) -> Path:
    """Return the wheel of rosgrade; a newer kit may have been unpacked over an older one."""

    def version(wheel: Path) -> List[int]:
        return [int(number) for number in re.findall(r"\d+", wheel.name.split("-")[1])]

    return max(kit.glob("rosgrade-*.whl"), key=version)


def _without_rosgrade(stamp: Mapping[str, str]) -> Dict[str, str]:
    """The stamp of the same environment as long as rosgrade itself is not in it."""
    return {**stamp, "pyproject": ""}


def _make_environment(venv: Path, chosen: Plan, lock_text: str, environ: Mapping[str, str]) -> None:
    """Make the environment anew, with all but rosgrade itself; a half-made one is removed."""
    _remove(venv)
    try:
        _create(venv, chosen)
        _install_lock(venv, requirements(lock_text, chosen))
        _check_imports(venv, environ)
    except BaseException:
        _remove(venv)
        raise


def main(root: Optional[str] = None) -> int:
    """Set up a course kit, or the checkout that this file lies in; return the exit code."""
    try:
        set_up(Path(root or Path(__file__).parents[2]).resolve(), os.environ)
    except SetupError as error:
        print(error, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130
    return 0


def lacking(interpreter: Interpreter) -> List[str]:
    """Return the packages of Debian and Ubuntu that rosgrade needs and this machine lacks."""
    packages = [package for program, package in _PROGRAMS.items() if not shutil.which(program)]
    for part, code in _PARTS_OF_PYTHON.items():
        if _run([interpreter.path, "-I", "-c", code]).returncode:
            packages.append(f"python{_dotted(interpreter.version)}-{part}")
    return packages


def _create(venv: Path, chosen: Plan) -> None:
    what, options = f"Python {_dotted(chosen.interpreter.version)}", []
    if chosen.ros == "system":
        what += ", with the sourced ROS"
        options = ["--system-site-packages"]
    _say(f"creating {VENV} ({what})")
    command = [chosen.interpreter.path, "-I", "-m", "venv", *options, str(venv)]
    _expect(command, "the virtual environment could not be made")


def _install_lock(venv: Path, lock_text: str) -> None:
    entries = read_lock(lock_text)
    # Some have an entry for each version of Python.
    total = len({entry.name for entry in entries})
    arrived = 0

    def tell_progress(line: str) -> None:
        nonlocal arrived
        if line.startswith(("Collecting ", "Requirement already satisfied: ")):
            arrived += 1
            if arrived % _PACKAGES_PER_LINE == 0:
                _say(f"{arrived} of {total} packages are here")
        elif arrived > _PACKAGES_PER_LINE and line.startswith("Installing collected packages"):
            _say(f"{arrived} of {total} packages are here and being unpacked")

    _say(f"fetching {total} packages")
    tools = [entry for entry in entries if entry.name in _BUILD_TOOLS]
    others = [entry for entry in entries if entry.name not in _BUILD_TOOLS]
    for stage, part in enumerate((tools, others)):
        path = venv / f"requirements-{stage}.txt"
        path.write_text("".join(entry.text for entry in part), encoding="utf-8")
        # Built without isolation, a source uses the locked tools: nothing unlocked is fetched.
        options = ["--no-deps", "--no-build-isolation", "--use-pep517", "--require-hashes"]
        problem = "the packages could not be installed; is the package index reachable?"
        _pip(venv, [*options, "-r", str(path)], problem, tell_progress)


def _add_ros2(venv: Path, environ: Mapping[str, str]) -> None:
    """Build the command `ros2`, which no wheel has, where its sources can be had; else say how."""
    _say("building the command ros2 (a minute; not where github.com cannot be reached)")
    rosgrade = str(venv / "bin" / "rosgrade")
    command = [rosgrade, "underlay", "add", "--wait", "10", "ros2cli"]

    def pass_on(line: str) -> None:
        if not line.startswith(_ERROR_MARK):
            print(line, end="", flush=True)

    try:
        done = _run(command, _clean(environ), pass_on)
        if not done.returncode:
            return
        reason = _last_line(done.stdout)
    except OSError as error:
        reason = str(error)
    reason = reason.replace(_ERROR_MARK, "")
    _say(f"no ros2 yet ({reason}); to get it: {VENV}/bin/rosgrade underlay add ros2cli")


def _import_underlays(root: Path, environ: Mapping[str, str]) -> None:
    """Take the built packages that a course gives along; quick where they are there already."""
    archive, address = root / UNDERLAYS_FILE, root / UNDERLAYS_PLACE
    if archive.is_file():
        place = str(archive)
    elif address.is_file():
        place = address.read_text(encoding="utf-8").strip()
    else:
        return
    if not place:
        return
    command = [str(root / VENV / "bin" / "rosgrade"), "underlay", "import", place]
    done = _run(command, _clean(environ))
    answer = _last_line(done.stdout)
    if done.returncode:
        _say(f"built packages were not imported ({answer.replace(_ERROR_MARK, '')})")
    else:
        _say(f"built packages: {answer.replace(_MARK, '')}")


def _last_line(output: str) -> str:
    """The line in which a command of rosgrade says how it ended."""
    return (output.splitlines() or ["no reason"])[-1]


def _clean(environ: Mapping[str, str]) -> Dict[str, str]:
    # The wheels' start-up hook leaves this to its children, which may be of another environment.
    return {k: v for k, v in environ.items() if k != "_ROS_WHEELS_BOOTSTRAP_COMPLETE"}


def _check_imports(venv: Path, environ: Mapping[str, str]) -> None:
    command = [str(venv / "bin" / "python"), "-c", "import geometry_msgs.msg, rclpy, scipy"]
    _expect(command, "what was installed does not work together", _clean(environ))


def _pip(venv: Path, arguments: List[str], problem: str, on_line: OnLine = str) -> None:
    # -I: neither a sourced ROS nor the working directory gets among pip's own modules.
    pip = [str(venv / "bin" / "python"), "-I", "-m", "pip", "--disable-pip-version-check"]
    _expect([*pip, "install", "--no-input", *arguments], problem, on_line=on_line)


def _run(
    command: List[str], environ: Optional[Mapping[str, str]] = None, on_line: OnLine = str
) -> "subprocess.CompletedProcess[str]":
    with subprocess.Popen(
        command,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        universal_newlines=True,
        errors="replace",
        env=None if environ is None else dict(environ),
    ) as process:
        lines = []
        for line in process.stdout or ():
            lines.append(line)
            on_line(line)
    return subprocess.CompletedProcess(command, process.returncode, "".join(lines))


def _expect(
    command: List[str],
    problem: str,
    environ: Optional[Mapping[str, str]] = None,
    on_line: OnLine = str,
) -> None:
    done = _run(command, environ, on_line)
    if done.returncode:
        sys.stderr.write(done.stdout)
        raise SetupError(problem)


def _interpreter(path: Optional[str]) -> Iterator[Interpreter]:
    """Yield the interpreter at `path` if it runs: a version manager's stand-in may not."""
    if not path:
        return
    # The real path, as `path` may lie in the very environment that is about to be replaced.
    code = "import os, sys; print(*sys.version_info[:2], os.path.realpath(sys.executable))"
    answer = re.fullmatch(r"(\d+) (\d+) (.+)\n", _run([path, "-I", "-c", code]).stdout)
    if answer:
        yield Interpreter((int(answer.group(1)), int(answer.group(2))), answer.group(3))


def _sourced(environ: Mapping[str, str]) -> str:
    """Return the distribution that is sourced; empty if none is."""
    # Images of ROS export ROS_DISTRO without sourcing anything; other tools set the path alone.
    return environ.get("ROS_DISTRO", "") if environ.get("AMENT_PREFIX_PATH") else ""


def _prefixes(ament_prefix_path: str) -> List[Path]:
    return [Path(prefix) for prefix in ament_prefix_path.split(os.pathsep) if prefix]


@contextmanager
def _alone(root: Path) -> Iterator[None]:
    """Let a second set-up of the same checkout wait for the first."""
    folder = os.open(str(root), os.O_RDONLY)
    try:
        fcntl.flock(folder, fcntl.LOCK_EX)
        yield
    finally:
        os.close(folder)


def _read_stamp(venv: Path) -> Dict[str, str]:
    """Return what the environment was made for; empty if it is unfinished or its Python is gone."""
    try:
        stamp = json.loads((venv / STAMP).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return stamp if isinstance(stamp, dict) and (venv / "bin" / "python").exists() else {}


def _write_stamp(venv: Path, stamp: Mapping[str, str]) -> None:
    (venv / STAMP).write_text(json.dumps(stamp, indent=1) + "\n", encoding="utf-8")


def _remove(venv: Path) -> None:
    if venv.exists():
        shutil.rmtree(str(venv))


def _dotted(version: Optional[Version]) -> str:
    return ".".join(map(str, version or ()))


def _supported() -> str:
    return f"{_dotted(SUPPORTED[-1])} to {_dotted(SUPPORTED[0])}"


def _say(text: str) -> None:
    print(f"rosgrade: {text}", flush=True)


if __name__ == "__main__":
    sys.exit(main())
