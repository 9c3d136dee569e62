"""Submissions that fight: each costs its own points, is named in its report, and nothing else.

They are graded together, several at once, with an honest submission before and after them that
must get the same grade as ever.
"""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from grader.batch.grading import Graded, Grading
from grader.checks.finding import Status
from grader.report.html import render_report
from grader.report.facts import RunFacts
from grader.run.descendants import descendants
from tests.attacks.submissions import write_submission

pytestmark = [pytest.mark.ros, pytest.mark.slow]

BOMB = """\
import os
def bomb():
    while True:
        try:
            if os.fork() == 0:
                os.setsid()
        except OSError:
            pass
bomb()
"""
DAEMON = """\
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        subprocess.run([sys.executable, '-c', 'import time; time.sleep(86397)'])
    os._exit(0)
"""
MANY_HOGS = """\
for number in range(8):
    if os.fork() == 0:
        x = b'x' * (80 * 2**20)
        time.sleep(60)
time.sleep(60)
"""
FORGED = """\
import json
fd = int(os.environ['ROSGRADE_TRACER_FD'])
for kind in ('node', 'publisher', 'spin', 'held', 'leaving', 'exiting'):
    os.write(fd, json.dumps({'kind': kind, 'node': '/forged', 'topic': '/forged', 'depth': 7,
                             'waited_s': 1e308}).encode() + b'\\n')
os.write(fd, b'\\xff' * 3000 + b'\\n' + b'[' * 3000 + b'\\n{"kind": "timer", "period_s": 1e999}\\n')
"""
SQUAT = """\
global other, spinner
context = rclpy.context.Context(); rclpy.init(context=context)
other = rclpy.create_node('rosgrade_probe', context=context)
from nav_msgs.msg import Odometry
from rosgraph_msgs.msg import Clock
node.fakes = [other.create_publisher(Odometry, '/odom', 10), other.create_publisher(Clock, '/clock', 10)]
for fake in node.fakes:
    for _ in range(50):
        fake.publish(fake.msg_type())
"""
FLOOD_TOPICS = """\
from std_msgs.msg import String
big = node.create_publisher(String, '/cmd_vel_flood', 10)
message = String(data='x' * 2**20)
for _ in range(20):
    big.publish(message)
for _ in range(3000):
    node.publisher.publish(Twist())
for _ in range(2000):
    node.get_logger().info('spam')
"""
KILL_PROBE = """\
own = set(map(int, os.listdir('/proc/self/task')))
for number in (signal.SIGKILL, signal.SIGTERM, signal.SIGSTOP, signal.SIGSEGV):
    for pid in (1, os.getppid(), *range(2, 400)):
        if pid not in own:
            try:
                os.kill(pid, number)
            except OSError:
                pass
"""
GARBAGE = """\
import random, socket
udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
for port in (7400, 7401, 7410, 7411, 7412, 7413):
    for _ in range(200):
        udp.sendto(b'RTPS' + random.randbytes(200), ('127.0.0.1', port))
"""
INJECTION = """\
print('\\x1b[2J\\x1b]0;owned\\x07<script>alert(1)</script>')
raise RuntimeError('<script>alert(2)</script><img src=x onerror=alert(3)>\\x1b[31m=cmd|calc')
"""


@dataclass(frozen=True)
class Attack:
    """A hostile submission and what must come of it.

    Attributes:
        lost: Checks that fail; others pass or are skipped because of them.
        maybe: Checks that may fail besides.
        named: Texts that its findings, log or breaches hold.
    """

    attack: str = ""
    at_import: str = ""
    at_build: str = ""
    name: str = "bot_publisher"
    files: dict[str, str] = field(default_factory=dict)
    lost: frozenset[str] = frozenset()
    maybe: frozenset[str] = frozenset()
    named: tuple[str, ...] = ()


ALIVE = frozenset({"alive", "messages"})
ATTACKS = {
    "kills_everything": Attack("os.kill(-1, signal.SIGKILL)\nos.kill(os.getpid(), 9)", lost=ALIVE, named=("SIGKILL",)),
    "kills_the_probe": Attack(KILL_PROBE),
    "kills_its_group": Attack("os.killpg(0, signal.SIGKILL)", lost=ALIVE, named=("SIGKILL",)),
    "fork_bomb": Attack(BOMB, lost=ALIVE, named=("sessions",)),
    "heap": Attack(
        "x = []\nwhile True:\n    x.append(bytearray(2**24))",
        lost=frozenset({"messages"}),
        # A program that ran out of memory cannot always end itself.
        maybe=frozenset({"alive", "ends"}),
        named=("MemoryError",),
    ),
    "memory_of_many": Attack(MANY_HOGS, lost=ALIVE, named=("MiB of memory",)),
    "shared_memory_map": Attack(
        "import mmap\nm = mmap.mmap(-1, 3 * 2**30)\nfor i in range(0, len(m), 4096):\n    m[i] = 1",
        lost=ALIVE,
        named=("MiB of memory",),
    ),
    "fills_the_disk": Attack(
        "for i in range(9):\n    open(f'/tmp/{i}', 'wb').write(bytes(2**22))",
        lost=ALIVE,
        named=("No space left on device", "all space in /tmp and home"),
    ),
    "one_huge_file": Attack(
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\nos.truncate(os.open('/tmp/x', os.O_CREAT | os.O_RDWR), 2**40)",
        lost=ALIVE,
        named=("File too large",),
    ),
    "a_million_files": Attack(
        "for i in range(10**6):\n    open(f'/tmp/{i}', 'w').close()",
        lost=ALIVE,
        named=("No space left on device",),
    ),
    "fills_shared_memory": Attack(
        "open('/dev/shm/x', 'wb').write(bytes(2**25 - 2**20))", lost=ALIVE, named=("No space left",)
    ),
    "endless_output": Attack(
        "block = b'spam ' * 2**15\nwhile True:\n    os.write(1, block)",
        lost=ALIVE,
        named=("MiB of output",),
    ),
    "daemon": Attack(DAEMON, lost=frozenset({"ends"}), named=("86397",)),
    "ignores_signals": Attack(
        "for n in (2, 15, 1):\n    signal.signal(n, signal.SIG_IGN)\nwhile True:\n    node.tick() or time.sleep(.1)",
        lost=frozenset({"ends"}),
        named=("SIGKILL",),
    ),
    "stops_itself": Attack("os.kill(os.getpid(), signal.SIGSTOP)", lost=frozenset({"messages", "ends"})),
    "sleeps": Attack(at_import="time.sleep(1000)", lost=frozenset({"starts"})),
    "leaves_at_once": Attack(at_import="os._exit(0)", lost=frozenset({"starts"})),
    "another_domain": Attack(
        at_import="os.environ['ROS_DOMAIN_ID'] = '5'",
        lost=frozenset({"starts"}),
        named=("joined ROS domain 5",),
    ),
    "forged_tracer": Attack(FORGED),
    "squats_the_probe_s_name": Attack(SQUAT),
    "is_called_as_the_probe": Attack(name="rosgrade_probe", lost=frozenset({"node"})),
    "floods_topics_and_rosout": Attack(FLOOD_TOPICS),
    "garbage_on_dds_ports": Attack(GARBAGE),
    "injection": Attack(INJECTION, lost=ALIVE, named=("RuntimeError",)),
    "shadows_modules": Attack(
        files={"numpy/__init__.py": "raise SystemExit('trojan')", "yaml/__init__.py": "raise SystemExit('trojan')"},
        lost=frozenset({"starts"}),
    ),
    "build_fork_bomb": Attack(
        at_build=BOMB, lost=frozenset({"builds"}), named=("it started 128 processes",)
    ),
    "build_plants_links": Attack(
        at_build="import os\nos.makedirs('../install', exist_ok=True)\n"
        "open('bot_publisher/own.py', 'w').write('')\n"
        "os.path.islink('bot_publisher/passwd') or os.symlink('/etc/passwd', 'bot_publisher/passwd')",
    ),
    "build_installs_outside": Attack(
        at_build="import setuptools\n_s = setuptools.setup\ndef setup(**k):\n"
        "    k['data_files'].append(('/etc/cron.d', ['package.xml']))\n    _s(**k)\nsetuptools.setup = setup",
        lost=frozenset({"builds"}),
    ),
    "build_memory": Attack(
        at_build="x = bytearray(2**32)", lost=frozenset({"builds"}), named=("MemoryError",)
    ),
    "build_disk": Attack(
        at_build="import os\nfor i in range(40):\n    open(f'{os.environ[\"HOME\"]}/{i}', 'wb').write(bytes(2**26))",
        lost=frozenset({"builds"}),
        named=("MiB",),
    ),
    "build_output": Attack(
        at_build="import sys\nwhile True:\n    sys.stderr.write('spam ' * 10**5)",
        lost=frozenset({"builds"}),
        named=("too much output",),
    ),
}


def status(graded: Graded) -> dict[str, Status]:
    return {result.id: result.status for result in graded.grade.results}


def told(graded: Graded) -> str:
    """All that a report is made from."""
    findings = [str(result.findings) for result in graded.grade.results]
    runs = [
        f"{recording.breaches} {recording.processes} {[line.text for line in recording.log]}"
        for recording in graded.recordings.values()
    ]
    build = graded.prepared.record.build
    return "\n".join([*findings, *runs, build.log if build else ""])


def gist(graded: Graded) -> str:
    """What a failing test shows."""
    lines = [
        f"{result.id} {result.status.value}: {result.decisive.finding.observed}"
        for result in graded.grade.results
        if result.status is not Status.PASSED
    ]
    for recording in graded.recordings.values():
        lines += [f"{recording.breaches} {recording.processes} {recording.faults}"]
        lines += [line.text for line in recording.log][-5:]
    build = graded.prepared.record.build
    return "\n".join([*lines, build.log[-500:] if build and not build.succeeded else ""])


@pytest.fixture(scope="module")
def honest(grading: Grading, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Graded]:
    folder = tmp_path_factory.mktemp("honest")
    submission = write_submission(folder / "ada")

    def grade(name: str) -> Graded:
        return grading.grade(submission, folder / name)

    return grade


@pytest.fixture(scope="module")
def graded(
    grading: Grading, honest: Callable[[str], Graded], tmp_path_factory: pytest.TempPathFactory
) -> dict[str, Graded]:
    """All of them, graded at once with honest ones among them."""
    folder = tmp_path_factory.mktemp("hostile")

    def grade(name: str) -> Graded:
        if name.startswith("honest"):
            return honest(name)
        attack = ATTACKS[name]
        submission = write_submission(
            folder / name,
            attack=attack.attack,
            at_import=attack.at_import,
            at_build=attack.at_build,
            name=attack.name,
            files=attack.files,
        )
        return grading.grade(submission, folder / "out" / name)

    names = ["honest_before", *ATTACKS, "honest_after"]
    names.insert(len(names) // 2, "honest_among")
    with ThreadPoolExecutor(2) as pool:
        return dict(zip(names, pool.map(grade, names), strict=True))


@pytest.mark.timeout(500)
@pytest.mark.parametrize("name", ATTACKS)
def test_an_attack_costs_its_own_points_and_is_named(name: str, graded: dict[str, Graded]) -> None:
    attack, result = ATTACKS[name], graded[name]
    failed = {check for check, found in status(result).items() if found is Status.FAILED}
    assert attack.lost <= failed <= attack.lost | attack.maybe, gist(result)
    assert result.grade.graded, gist(result)
    for text in attack.named:
        assert text in told(result), gist(result)


@pytest.mark.parametrize("name", ["honest_before", "honest_among", "honest_after"])
def test_nothing_else_changes(name: str, graded: dict[str, Graded]) -> None:
    assert graded[name].grade.full_points, gist(graded[name])


def test_nothing_is_left_running(graded: dict[str, Graded]) -> None:
    # Whoever outlived its parent in a namespace is still a descendant of the one who made it.
    commands = descendants(os.getpid()).values()
    assert not [line for line in commands if re.search("86397|bot_pub|setup.py", line)]


def test_what_it_prints_is_shown_and_never_executed(graded: dict[str, Graded]) -> None:
    result = graded["injection"]
    page = render_report(result.grade, result.recordings, RunFacts("now", 1.0))
    assert "alert(2)" in page
    assert "<script>alert" not in page and "<img src=x" not in page
    assert "\x1b" not in page
