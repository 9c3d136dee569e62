"""Students' processes that are forked: nobody can tell them from those that Python starts anew."""

from __future__ import annotations

import json
import os
import re
import select
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from grader import ros
from grader.recording.mcap_reader import read_recording
from grader.recording.model import Recording
from grader.run.descendants import descendants
from grader.run.environment import TRACER
from grader.run.forked import _dismiss
from grader.run.runner import Runner
from grader.run.zygote import IMPORTS, Zygotes
from grader.sandbox.sandbox import Sandbox
from grader.sandbox.trial import try_sandbox
from tests.run import nodes
from tests.run.conftest import SUBMISSION, assignment, install

pytestmark = pytest.mark.ros

_PARENT = "import os; print('parent', os.getppid(), flush=True)\n"
_MOST_TRIES = 20


class Pair:
    """Runs programs both ways."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._sandbox = Sandbox(folder / "cache")
        self._numbers = iter(range(10_000))
        self._warm = Runner(ros.find(), sandbox=self._sandbox)
        for _ in range(_MOST_TRIES):
            recording = self._run(self._warm, _PARENT)
            if lines(recording)[0] != "parent 1":
                return
        raise AssertionError("nothing was forked")

    def close(self) -> None:
        self._warm.close()

    def anew(self, source: str, **scenario: Any) -> Recording:
        """By an interpreter that is started for it."""
        with Runner(ros.find(), sandbox=self._sandbox) as runner:
            return self._run(runner, source, **scenario)

    def forked(self, source: str, **scenario: Any) -> Recording:
        """By a zygote."""
        return self._run(self._warm, source, **scenario)

    def _run(self, runner: Runner, source: str, **scenario: Any) -> Recording:
        folder = self._folder / str(next(self._numbers))
        space = install(folder, source)
        for name, text in scenario.pop("modules", {}).items():
            (space / "lib" / "bot_publisher" / name).write_text(text, encoding="utf-8")
        for name, text in scenario.pop("more", {}).items():
            program = space / "lib" / "bot_publisher" / name
            program.write_text(f"#!{sys.executable}\n{text}", encoding="utf-8")
            program.chmod(0o755)
        course = assignment(**scenario)
        file = folder / "run.mcap"
        runner.run(course, course.scenarios[0], SUBMISSION, space, file, seed=1)
        return read_recording(file)


def lines(recording: Recording) -> list[str]:
    return [line.text for line in recording.log if line.stream in ("stdout", "stderr")]


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Pair]:
    found = try_sandbox()
    if found.problem:
        pytest.skip(f"no sandbox on this machine: {found.problem}; {found.remedy}")
    pair = Pair(tmp_path_factory.mktemp("zygote"))
    yield pair
    pair.close()


PORTRAIT = """
import sys
main = {name: repr(value) for name, value in vars().items()}
modules = sorted(sys.modules)
import gc, json, os, resource, signal, socket, stat, threading
status = dict(line.split(":", 1) for line in open("/proc/self/status"))
def stream(one):
    return [one.encoding, one.errors, one.line_buffering, one.write_through, one.mode,
            one.isatty(), stat.filemode(os.fstat(one.fileno()).st_mode)]
of_run = ("ROSGRADE_TRACER_FD", "ROSGRADE_TRACER_PIPE", "ROSGRADE_SEEN_FD")
def dump(**facts):
    for name, value in facts.items():
        print(json.dumps([name, value]), flush=True)
dump(
    main=main, modules=modules, argv=sys.argv, orig_argv=sys.orig_argv, flags=repr(sys.flags),
    path=sys.path, executable=sys.executable, prefix=sys.prefix,
    cwd=os.getcwd(), uid=os.getresuid(), gid=os.getresgid(), groups=os.getgroups(),
    umask=os.umask(0o22), environment={n: v for n, v in os.environ.items() if n not in of_run},
    leads=os.getpid() == os.getpgrp(), session=os.getpgrp() == os.getsid(0),
    limits=[resource.getrlimit(i) for i in range(16)], host=socket.gethostname(),
    status={n: status[n] for n in status if n.startswith(("Cap", "Sig", "Shd", "NoNew", "Secc",
        "Uid", "Gid", "Groups", "Umask", "Cpus_allowed_list"))},
    handlers={i: repr(signal.getsignal(i)) for i in signal.valid_signals()},
    streams=[stream(sys.stdin), stream(sys.stdout), stream(sys.stderr)],
    descriptors=sorted(os.path.basename(os.readlink(f"/proc/self/fd/{n}")).split("[")[0]
        for n in os.listdir("/proc/self/fd") if os.path.exists(f"/proc/self/fd/{n}")),
    mounts=sorted(line.split()[4] for line in open("/proc/self/mountinfo")),
    command=open("/proc/self/cmdline").read(), exe=os.readlink("/proc/self/exe"),
    own=oct(os.stat("/proc/self/mem").st_mode) + str(os.stat("/proc/self/mem").st_uid),
    gc=[gc.get_threshold(), gc.isenabled()], threads=threading.active_count(),
    nice=os.nice(0), cpu=sorted(os.sched_getaffinity(0)), root=sorted(os.listdir("/")),
    oom=open("/proc/self/oom_score_adj").read(),
    namespaces=sorted(os.listdir("/proc/self/ns")),
)
"""


# Handled by the C library itself, once a library of ROS's has made a thread; in a fork it makes
# these at the start, and not only with the import of rclpy.
_OF_LIBC = 1 << 32


def portrait(recording: Recording) -> dict[str, Any]:
    found = dict(json.loads(line) for line in lines(recording) if line.startswith('["'))
    found["main"] = {name: re.sub(" at 0x.*", "", text) for name, text in found["main"].items()}
    found["status"]["SigCgt"] = int(found["status"]["SigCgt"], 16) & ~_OF_LIBC
    return found


def test_a_forked_process_is_as_one_that_was_started(pair: Pair) -> None:
    anew, forked = portrait(pair.anew(PORTRAIT)), portrait(pair.forked(PORTRAIT))
    assert anew["modules"] and anew["mounts"]
    assert forked == anew


def outcome(recording: Recording) -> dict[str, Any]:
    """What came of a run, without what differs between any two."""
    numbers = re.compile(r"0x[0-9a-f]+|\[\d+\.\d+\]|\d{9,}")
    return {
        "lines": [numbers.sub("", line) for line in lines(recording)],
        "ends": [(one.exit_code, one.stopped_by, one.survivors) for one in recording.processes],
        "ending": recording.ending,
        "nodes": sorted(one.name for one in recording.nodes),
        "endpoints": sorted(
            (one.kind.value, one.topic, one.type, str(one.qos)) for one in recording.endpoints
        ),
        # One that starts Python anew says so.
        "declared": list(dict.fromkeys(one.kind for one in recording.declarations)),
        "breaches": recording.breaches,
    }


DEEP = """
import rclpy
from rclpy.node import Node
class Bot(Node):
    def __init__(self):
        super().__init__("bot")
        self.create_timer("soon", self.tick)
def main():
    rclpy.init()
    Bot()
if __name__ == "__main__":
    main()
"""
INTERRUPTED = "import time\ndef nap():\n    time.sleep(100)\nnap()"
FAMILY = """
import multiprocessing, os, subprocess, sys, threading, atexit
from concurrent.futures import ThreadPoolExecutor
def double(number):
    return 2 * number
def late():
    import time
    time.sleep(0.05)
    print("thread done", flush=True)
if __name__ == "__main__":
    atexit.register(print, "at exit", flush=True)
    print(subprocess.run([sys.executable, "-c", "print(6 * 7)"], capture_output=True).stdout)
    for way in ("fork", "spawn"):
        with multiprocessing.get_context(way).Pool(2) as pool:
            print(pool.map(double, range(4)), flush=True)
    with ThreadPoolExecutor(2) as pool:
        print(list(pool.map(double, range(4))), flush=True)
    threading.Thread(target=late).start()
    sys.stderr.write("no line end")
"""
TIMED = nodes.timed().replace(
    "rclpy.spin(node)", "try:\n    rclpy.spin(node)\nexcept KeyboardInterrupt:\n    print('bye')"
)
PROGRAMS = {
    "a node": TIMED,
    "an error in a node": DEEP,
    "a package without its module": "import geometry_msgs\nprint(geometry_msgs.msg.Twist())",
    "rclpy without its module": "import rclpy\nprint(rclpy.node.Node)",
    "an import that fails": "from rclpy.node import Nodes",
    "a module that is not there": "import turtlebot4_node",
    "a syntax error": "import rclpy\nprint('a'",
    "a status": "import sys; sys.exit(3)",
    "a message": "import sys; sys.exit('no robot')",
    "a status beyond signals": "import os; os._exit(130)",
    "a signal of its own": "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)",
    "an interrupt of its own": "import os, signal; os.kill(os.getpid(), signal.SIGINT)",
    "a group's signal": "import os, signal; os.killpg(0, signal.SIGTERM)",
    "processes and threads": FAMILY,
    "input": "print(input('How far? '))",
    "the shape of its log": (
        "import os\n"
        "os.environ['RCUTILS_CONSOLE_OUTPUT_FORMAT'] = '<{severity}> {message}'\n"
        "import rclpy\nrclpy.init()\n"
        "node = rclpy.create_node('talker')\nnode.get_logger().warning('hot')\n"
    ),
    "a node that nobody has destroyed": (
        "import rclpy\nrclpy.init()\nnode = rclpy.create_node('talker')\nrclpy.shutdown()\n"
    ),
    "another middleware": (
        "import os\nos.environ['RMW_IMPLEMENTATION'] = 'rmw_cyclonedds_cpp'\n"
        "import rclpy\nrclpy.init()\n"
    ),
    "a warning": "import warnings, numpy\nwarnings.warn('old', DeprecationWarning)",
    "objects that end with the program": (
        "class Robot:\n    def __del__(self):\n        print('stopped', flush=True)\n"
        "def wait():\n    try:\n        yield\n    finally:\n        print('closed', flush=True)\n"
        "robot = Robot()\nwaiting = wait()\nnext(waiting)\n"
    ),
    "folders of its own before Python's": (
        "import sys\nfrom pathlib import Path\n"
        "for name in ('queue.py', 'numpy/__init__.py'):\n"
        "    file = Path('/tmp/own', name)\n"
        "    file.parent.mkdir(parents=True, exist_ok=True)\n    file.touch()\n"
        "sys.path.insert(0, '/tmp/own')\n"
        "import json, numpy, queue\nprint(json.__file__, numpy.__file__, queue.__file__)\n"
        "import rclpy\nprint(rclpy.__file__)\nimport numpy.random\n"
    ),
    "folders of its own after Python's": (
        "import sys\nfrom pathlib import Path\nPath('queue.py').touch()\nsys.path.append('')\n"
        "import queue\nprint(queue.__file__)\n"
    ),
    "what is asked of C": (
        "import ctypes, os, threading\nprint(ctypes.get_errno())\n"
        "print(threading.main_thread().native_id == os.getpid())\n"
    ),
    "one left behind": "import subprocess; subprocess.Popen(['sleep', '100'])",
}


@pytest.mark.parametrize("name", PROGRAMS)
def test_what_comes_of_a_forked_process_is_the_same(name: str, pair: Pair) -> None:
    source = PROGRAMS[name]
    anew, forked = outcome(pair.anew(source)), outcome(pair.forked(source))
    assert forked == anew


# With one of them, Python is started anew in the fork.
@pytest.mark.parametrize("module", ["robot.py", "queue.py"])
def test_ctrl_c_comes_where_the_program_is(module: str, pair: Pair) -> None:
    anew, forked = (
        outcome(run(INTERRUPTED, discovery="1 s", modules={module: ""}))
        for run in (pair.anew, pair.forked)
    )
    assert anew["lines"][-1] == "KeyboardInterrupt"
    assert [stopped_by for _, stopped_by, _ in anew["ends"]] == ["SIGINT"]
    assert forked == anew


def test_a_module_of_the_student_s_comes_before_what_was_imported_ahead(pair: Pair) -> None:
    source = _PARENT + "import numpy\nprint(numpy.__file__, flush=True)"
    recording = pair.forked(source, modules={"numpy.py": ""})
    assert lines(recording)[-1] == "/ws/install/lib/bot_publisher/numpy.py"


def test_a_program_that_kills_its_parent_hides_nothing(pair: Pair) -> None:
    source = (
        "import os, signal, time\nos.kill(os.getppid(), signal.SIGKILL)\n"
        "print('on', flush=True)\ntime.sleep(100)"
    )
    (process,) = pair.forked(source, discovery="1 s").processes
    assert process.exit_code == -9
    assert process.survivors


def test_two_forked_processes_are_two_for_everybody(pair: Pair) -> None:
    def talker(number: int) -> str:
        return nodes.timed(value=float(number)).replace("bot_publisher", f"talker_{number}")

    scenario: dict[str, Any] = {
        "launch": [{"executable": "bot_pub"}, {"executable": "other"}],
        "until": {"elapsed": "4 s"},
        "timeout": "20 s",
        "more": {"other": talker(2)},
    }
    for run in (pair.anew, pair.forked, pair.forked, pair.forked):
        recording = run(talker(1), **scenario)
        assert len({one.name for one in recording.nodes if "talker" in one.name}) == 2
        assert {m.value["linear"]["x"] for m in recording.on("/cmd_vel")} == {1.0, 2.0}
        assert len([one for one in recording.endpoints if one.topic == "/cmd_vel"]) >= 2


@pytest.mark.xfail(
    reason="known fault: the cell may wait for its own limit after an interpreter that imported "
    "ahead was killed",
    run=False,
)
def test_without_its_zygote_a_program_is_started_anew(pair: Pair) -> None:
    for pid, command in descendants(os.getpid()).items():
        if command.endswith("/ws/install/lib/bot_publisher/bot_pub"):
            os.kill(pid, signal.SIGKILL)
    assert lines(pair.forked(_PARENT)) == ["parent 1"]


@pytest.mark.parametrize(("source", "count"), [("", 1), ("print('deprecated', flush=True)", 0)])
def test_what_prints_while_it_imports_ahead_is_not_used(
    source: str, count: int, tmp_path: Path
) -> None:
    (tmp_path / "argparse.py").write_text(source, encoding="utf-8")
    environment = ros.find().environment(os.environ)
    environment["PYTHONPATH"] = os.pathsep.join((str(TRACER), str(tmp_path)))
    zygotes = Zygotes()
    for _ in range(2):
        zygotes.ask([sys.executable, "/nowhere/program"], environment, 0)
    (descriptor,) = zygotes.sockets()
    (zygote,) = zygotes._zygotes
    select.select([descriptor], [], [])
    zygotes.hear(descriptor)
    assert len(zygotes.ready()) == count
    zygotes.close()
    assert zygote.popen.wait() == 0


def test_a_zygote_that_hangs_is_ended_once_a_cell_has_dismissed_it() -> None:
    environment = {**ros.find().environment(os.environ), "PYTHONPATH": str(TRACER)}
    zygotes = Zygotes()
    for _ in range(2):
        zygotes.ask([sys.executable, "/nowhere/program"], environment, 0)
    (zygote,) = zygotes._zygotes
    zygotes.hear(zygote.socket.fileno())
    (descriptor,) = zygotes.ready().values()
    zygote.popen.send_signal(signal.SIGSTOP)
    _dismiss(descriptor)
    zygotes.hear(descriptor)
    assert not zygotes.ready()
    assert zygote.popen.wait() == -signal.SIGKILL


def test_a_zygote_that_is_asked_for_nonsense_runs_nothing(tmp_path: Path) -> None:
    program = tmp_path / "program"
    program.write_text(f"open({str(tmp_path / 'ran')!r}, 'w')", encoding="utf-8")
    environment = {**ros.find().environment(os.environ), "PYTHONPATH": str(TRACER)}
    zygotes = Zygotes()
    for _ in range(2):
        zygotes.ask([sys.executable, str(program)], environment, 0)
    (zygote,) = zygotes._zygotes
    zygotes.hear(zygote.socket.fileno())
    zygote.socket.send(b"{}")
    assert zygote.popen.wait() == 1
    zygotes.close()
    assert not (tmp_path / "ran").exists()


def test_forks_do_not_share_random_numbers(pair: Pair) -> None:
    source = "import random, numpy\nprint(random.random(), numpy.random.rand(), flush=True)"
    first, second = (lines(pair.forked(source))[0].split() for _ in range(2))
    assert first[0] != second[0]
    assert first[1] != second[1]


def test_whoever_only_looks_for_a_module_does_not_use_it_up(pair: Pair) -> None:
    source = (
        "import importlib.util, inspect\nspec = importlib.util.find_spec('numpy')\n"
        "print(spec.origin, spec.has_location, len(spec.loader.get_source('numpy')))\n"
        "import numpy, rclpy\nprint(numpy.__spec__.loader, rclpy.__file__, numpy.__file__)\n"
        "print(len(inspect.getsource(rclpy.init)))"
    )
    anew, forked = outcome(pair.anew(source)), outcome(pair.forked(source))
    assert forked == anew


PRISON = """
import os
for pid in sorted(filter(str.isdigit, os.listdir("/proc")), key=int):
    if pid == "1":
        print(os.listdir("/proc/1"))
        continue
    status = dict(line.split(":", 1) for line in open(f"/proc/{pid}/status"))
    print(pid, status["Seccomp_filters"].strip(), status["CapEff"].strip(), flush=True)
try:
    print(os.listdir(f"/proc/{os.getppid()}/fd"))
except PermissionError as error:
    print("the parent is closed", flush=True)
"""


def test_every_process_of_its_sandbox_is_as_bound_as_itself(pair: Pair) -> None:
    init, *processes, parent = lines(pair.forked(PRISON))
    # Nothing reaches it, not even through its files.
    assert init == "[]"
    assert len(processes) >= 3
    assert {line.split()[1] for line in processes} == {"2"}
    assert parent == "the parent is closed"


IMPORTING = (
    "",
    "import rclpy",
    "from rclpy.node import Node",
    "import rclpy.executors",
    "import std_msgs",
    "from geometry_msgs.msg import Twist",
    "import numpy",
    "from nav_msgs.msg import Odometry\nimport rclpy\nfrom rclpy.qos import QoSProfile",
    "import importlib.util",
    "from importlib.metadata import distribution",
    "import json, random, threading, argparse",
    "import asyncio",
)
_SEEN = """
import sys
def names(module):
    return sorted(name for name, value in vars(module).items() if type(value) is type(sys))
seen = {name: names(one) for name, one in sorted(sys.modules.items()) if hasattr(one, "__dict__")}
import atexit, json
print(json.dumps([seen, atexit._ncallbacks()]))
"""


@pytest.mark.parametrize("imports", IMPORTING)
def test_a_program_sees_what_it_has_imported_and_no_more(imports: str, tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(
        "import os\n"
        "if 'AHEAD' in os.environ:\n"
        "    import sys, _rosgrade_ahead\n"
        "    ahead = _rosgrade_ahead.Ahead()\n"
        "    ahead.load(os.environ.pop('AHEAD').split())\n"
        "    ahead.be_as_at_the_start()\n"
        "    del sys.modules['_rosgrade_ahead'], _rosgrade_ahead, ahead, sys\n",
        encoding="utf-8",
    )
    environment = ros.find().environment(os.environ)
    environment["PYTHONPATH"] = os.pathsep.join((str(tmp_path), str(TRACER)))
    seen = []
    for ahead in ({}, {"AHEAD": " ".join(IMPORTS)}):
        done = subprocess.run(
            [sys.executable, "-c", f"import atexit, __future__\n{imports}\n{_SEEN}"],
            env={**environment, **ahead},
            stdout=subprocess.PIPE,
            check=True,
        )
        seen.append(json.loads(done.stdout))
    (anew, at_exit), (ahead, at_exit_ahead) = seen
    assert len(anew) > 20
    assert at_exit_ahead == at_exit
    assert ahead == anew
