"""The decisions of the set-up; none of these tests installs anything."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from grader.machine import bootstrap
from grader.machine.bootstrap import Interpreter, Plan, SetupError

ROOT = Path(bootstrap.__file__).resolve().parents[2]
LINUX = "linux-x86_64"
SOURCED = {"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": "/opt/ros/jazzy"}

WHEELS = Plan("wheels", Interpreter((3, 13), "python3.13"))
SYSTEM = Plan("system", Interpreter((3, 12), "python3.12"))

LOCK = """\
colcon-core==0.21 \\
    --hash=sha256:aa
    # via rosgrade (pyproject.toml)
empy==4.2 \\
    --hash=sha256:bb
    # via
    #   colcon-core
    #   ros-rosidl-adapter
lark-parser==0.12 \\
    --hash=sha256:cc
    # via ros-rosidl-parser
numpy==2.2 ; python_full_version < '3.11' \\
    --hash=sha256:ee
    # via
    #   ros-rosidl-generator-py
    #   scipy
numpy==2.5 ; python_full_version >= '3.11' \\
    --hash=sha256:ff
    # via
    #   rosgrade (pyproject.toml)
    #   scipy
pyyaml==6.0 \\
    --hash=sha256:11
    # via
    #   colcon-core
    #   ros-rclpy
ros-rclpy==7.1.6 \\
    --hash=sha256:22
    # via rosgrade (pyproject.toml)
ros-rosidl-parser==4.6 \\
    --hash=sha256:33
    # via ros-rclpy
scipy==1.17 \\
    --hash=sha256:44
    # via rosgrade (pyproject.toml)
"""


def pythons(*versions: str) -> Iterator[Interpreter]:
    for version in versions:
        major, minor = version.split(".")
        yield Interpreter((int(major), int(minor)), f"python{version}")


@pytest.mark.parametrize("version", ["3.10", "3.13"])
def test_without_ros_the_wheels_go_into_the_running_python(version: str) -> None:
    running = next(pythons(version))
    assert bootstrap.plan({}, [running, WHEELS.interpreter], LINUX) == Plan("wheels", running)


@pytest.mark.parametrize("version", ["3.9", "3.14"])
def test_an_unsupported_python_gives_way_to_a_supported_one(version: str) -> None:
    chosen = bootstrap.plan({}, pythons(version, "3.13", "3.11"), LINUX)
    assert chosen.interpreter == Interpreter((3, 13), "python3.13")


def test_interpreters_are_looked_for_only_as_far_as_needed() -> None:
    found = pythons("3.11", "3.10")
    bootstrap.plan({}, found, LINUX)
    assert [interpreter.version for interpreter in found] == [(3, 10)]


def test_no_supported_python_names_what_to_install() -> None:
    expected = r"needs Python 3\.10 to 3\.13 and here is only 3\.9, 3\.14: sudo apt install"
    with pytest.raises(SetupError, match=expected):
        bootstrap.plan({}, pythons("3.9", "3.14"), LINUX)


def test_sourced_jazzy_is_used_with_the_python_that_it_was_built_for() -> None:
    chosen = bootstrap.plan(SOURCED, pythons("3.11", "3.12"), LINUX, ros_python=(3, 12))
    assert chosen == SYSTEM


@pytest.mark.parametrize(
    "environ",
    [
        {"ROS_DISTRO": "jazzy"},
        {"ROS_DISTRO": "humble", "AMENT_PREFIX_PATH": ""},
        {"AMENT_PREFIX_PATH": "/somewhere"},
    ],
)
def test_a_ros_that_is_not_sourced_does_not_count(environ: dict[str, str]) -> None:
    assert bootstrap.plan(environ, pythons("3.11"), LINUX).ros == "wheels"


def test_another_distribution_is_refused_by_name() -> None:
    humble = {"ROS_DISTRO": "humble", "AMENT_PREFIX_PATH": "/opt/ros/humble"}
    with pytest.raises(SetupError, match=r"^ROS 2 Humble is sourced .* for ROS 2 Jazzy"):
        bootstrap.plan(humble, pythons("3.10"), LINUX, ros_python=(3, 10))


@pytest.mark.parametrize("built_for", [None, (3, 9)])
def test_a_sourced_jazzy_without_a_usable_rclpy_is_refused(
    built_for: tuple[int, int] | None,
) -> None:
    with pytest.raises(SetupError, match="or sudo apt install ros-jazzy-rclpy"):
        bootstrap.plan(SOURCED, pythons("3.12"), LINUX, ros_python=built_for)


def test_the_missing_python_of_a_sourced_jazzy_is_named() -> None:
    with pytest.raises(SetupError, match=r"sudo apt install python3\.12-venv$"):
        bootstrap.plan(SOURCED, pythons("3.11", "3.13"), LINUX, ros_python=(3, 12))


def test_a_platform_without_wheels_needs_a_sourced_ros() -> None:
    with pytest.raises(SetupError, match="this is linux-aarch64: source ROS 2 Jazzy"):
        bootstrap.plan({}, pythons("3.11"), "linux-aarch64")


def test_wheels_take_the_whole_lock() -> None:
    assert bootstrap.requirements(LOCK, WHEELS) == LOCK


def test_a_sourced_ros_takes_neither_its_own_packages_nor_what_it_is_built_against() -> None:
    kept = bootstrap.read_lock(bootstrap.requirements(LOCK, SYSTEM))
    assert [entry.name for entry in kept] == ["colcon-core", "pyyaml", "scipy"]
    assert all("--hash=sha256:" in entry.text for entry in kept)


def test_the_lock_of_this_checkout_holds_one_distribution_of_ros() -> None:
    lock = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    versions = {entry.name: entry.text.split()[0] for entry in bootstrap.read_lock(lock)}
    # Each is a version of Jazzy; Kilted has another major or minor version of every one.
    jazzy = {
        "ros-rclpy": "7.1",
        "ros-rcl": "9.2",
        "ros-rcutils": "6.7",
        "ros-rmw": "7.3",
        "ros-rmw-fastrtps-cpp": "8.4",
        "ros-fastrtps": "2.14",
        "ros-rosidl-runtime-c": "4.6",
        "ros-geometry-msgs": "5.3",
        "ros-ament-cmake-core": "2.5",
    }
    assert {name: versions[name].split("==")[1].rsplit(".", 1)[0] for name in jazzy} == jazzy


def test_the_lock_of_this_checkout_leaves_ros_to_a_sourced_one() -> None:
    lock = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    kept = {entry.name for entry in bootstrap.read_lock(bootstrap.requirements(lock, SYSTEM))}
    assert not {name for name in kept if name.startswith("ros-")}
    assert kept.isdisjoint({"numpy", "empy", "lark-parser"})
    assert kept >= {"colcon-ros", "hatchling", "mcap", "pytest", "pyyaml", "scipy", "setuptools"}


def test_the_python_of_a_sourced_ros_is_read_from_where_rclpy_lies(tmp_path: Path) -> None:
    (tmp_path / "overlay").mkdir()
    (tmp_path / "jazzy/lib/python3.12/site-packages/rclpy").mkdir(parents=True)
    path = f"{tmp_path}/overlay:{tmp_path}/jazzy"
    assert bootstrap.find_ros_python(path) == (3, 12)
    assert bootstrap.find_ros_python(f"{tmp_path}/overlay") is None
    assert bootstrap.find_ros_python("") is None


def test_the_running_python_is_found_first_outside_of_any_environment() -> None:
    found = next(bootstrap.find_interpreters({}))
    assert found == Interpreter(sys.version_info[:2], str(Path(sys.executable).resolve()))


def test_it_needs_nothing_installed() -> None:
    modules = (
        "import sys, grader.machine.bootstrap; print(*{name.split('.')[0] for name in sys.modules})"
    )
    command = [sys.executable, "-S", "-c", modules]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) - {"grader", "__main__"} <= {
        *sys.stdlib_module_names,
        "sitecustomize",
    }


PRETENDED = """\
import os, sys
from pathlib import Path
from grader.machine import bootstrap

def create(venv, chosen):
    (venv / "bin").mkdir(parents=True)
    (venv / "bin" / "python").touch()
    (venv / "pyvenv.cfg").touch()
    (venv / "made_for").write_text((venv.parent / "requirements.lock").read_text())

bootstrap._create = create
bootstrap._install_lock = bootstrap._check_imports = bootstrap._pip = lambda *_: None
{change}
bootstrap.set_up(Path(sys.argv[1]), {{}})
"""
"""A set-up of an environment with nothing in it."""


def set_up(root: Path, lock: str, change: str = "") -> int:
    (root / "requirements.lock").write_text(lock, encoding="utf-8")
    (root / "pyproject.toml").touch()
    command = [sys.executable, "-c", PRETENDED.format(change=change), str(root)]
    environ = {k: v for k, v in os.environ.items() if k != "AMENT_PREFIX_PATH"}
    return subprocess.run(
        command, cwd=ROOT, env=environ, capture_output=True, check=False
    ).returncode


def made_for(root: Path) -> str:
    """The lock that the environment in place was made for, if it is finished."""
    stamp = json.loads((root / ".venv" / bootstrap.STAMP).read_text(encoding="utf-8"))
    assert stamp["pyproject"]
    return (root / ".venv" / "made_for").read_text(encoding="utf-8")


def test_other_requirements_make_another_environment_and_the_same_none(tmp_path: Path) -> None:
    assert set_up(tmp_path, "one") == 0
    assert set_up(tmp_path, "one", "bootstrap._create = None") == 0
    assert set_up(tmp_path, "two") == 0
    assert made_for(tmp_path) == "two"


@pytest.mark.parametrize("step", ["_create", "_install_lock", "_check_imports", "_pip"])
def test_after_a_set_up_that_was_killed_the_next_one_makes_it_whole(
    tmp_path: Path, step: str
) -> None:
    kill = f"bootstrap.{step} = lambda *_: os.kill(os.getpid(), 9)"
    assert set_up(tmp_path, "one", kill) == -signal.SIGKILL
    assert set_up(tmp_path, "one") == 0
    assert made_for(tmp_path) == "one"


PIP = """\
import sys
for name in range(45):
    print(f"Collecting name-{name}")
print("Installing collected packages: name-0")
"""


def test_a_set_up_says_how_far_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def pip(venv, arguments, problem, on_line=str) -> None:
        bootstrap._expect([sys.executable, "-c", PIP], problem, on_line=on_line)

    monkeypatch.setattr(bootstrap, "_pip", pip)
    bootstrap._install_lock(tmp_path, "\n".join(f"name-{number}==1" for number in range(45)))
    told = capsys.readouterr().out
    assert "fetching 45 packages" in told and "40 of 45 packages are here\n" in told
    assert "45 of 45 packages are here and being unpacked" in told


def test_one_line_installs_all_that_the_system_lacks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bare = tmp_path / "python3.12"
    bare.write_text("#!/bin/sh\nexit 1\n")
    bare.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    lacks = bootstrap.lacking(Interpreter((3, 12), str(bare)))
    assert [name.replace("3.12", "3") for name in sorted(lacks)] == bootstrap.APT.split()


@pytest.mark.parametrize("page", ["README.md", "docs/first-grade.md"])
def test_the_pages_name_all_that_rosgrade_takes_from_the_system(page: str) -> None:
    assert f"sudo apt install {bootstrap.APT}\n" in (ROOT / page).read_text(encoding="utf-8")


def test_a_set_up_without_the_sources_of_ros2_says_in_one_line_how_to_get_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rosgrade = tmp_path / "bin/rosgrade"
    rosgrade.parent.mkdir()
    rosgrade.write_text(
        "#!/bin/sh\necho fetching >&2\necho 'rosgrade: error: no network' >&2\nexit 3\n"
    )
    rosgrade.chmod(0o755)
    bootstrap._add_ros2(tmp_path, os.environ)
    told = capsys.readouterr().out.splitlines()
    assert told[1:] == [
        "fetching",
        "rosgrade: no ros2 yet (no network); to get it: .venv/bin/rosgrade underlay add ros2cli",
    ]


@pytest.mark.parametrize(
    ("file", "status", "told"),
    [
        (None, 0, []),
        ("underlays.txt", 0, ["rosgrade: built packages: Imported: rclcpp"]),
        ("underlays.tar.gz", 3, ["rosgrade: built packages were not imported (no room)"]),
    ],
)
def test_a_set_up_imports_the_built_packages_that_lie_beside_it_and_goes_on_without(
    file: str | None,
    status: int,
    told: list[str],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    rosgrade = tmp_path / ".venv/bin/rosgrade"
    rosgrade.parent.mkdir(parents=True)
    last = "error: no room" if status else "Imported: rclcpp"
    rosgrade.write_text(
        f'#!/bin/sh\necho "$@" > {tmp_path}/called\necho "rosgrade: {last}"\nexit {status}\n'
    )
    rosgrade.chmod(0o755)
    if file is not None:
        (tmp_path / file).write_text("https://example.org/u.tar.gz#sha256=0\n")
    bootstrap._import_underlays(tmp_path, os.environ)
    assert capsys.readouterr().out.splitlines() == told
    place = tmp_path / "underlays.tar.gz" if status else "https://example.org/u.tar.gz#sha256=0"
    if file is not None:
        assert (tmp_path / "called").read_text() == f"underlay import {place}\n"


def test_a_set_up_that_fails_leaves_nothing_half_made(tmp_path: Path) -> None:
    assert set_up(tmp_path, "one", "bootstrap._install_lock = None") != 0
    assert not (tmp_path / ".venv").exists()


def test_of_the_wheels_of_two_kits_the_newer_one_is_installed(tmp_path: Path) -> None:
    for version in ("0.9.0", "0.10.0", "0.2.1"):
        (tmp_path / f"rosgrade-{version}-py3-none-any.whl").touch()
    assert bootstrap.newest_wheel(tmp_path).name == "rosgrade-0.10.0-py3-none-any.whl"
