"""Submissions that fight: each costs its own points, is named in its report, and nothing else.

A class of honest submissions is graded by itself, with all hostile ones among it, several at once,
and with those among it that hoard what all processes of a user share; the last as most shells start
things, with 1024 open files, and as an ordinary user. Every honest grade must be the same, byte for
byte.
"""

from __future__ import annotations

import html
import json
import os
import random
import re
import resource
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from grader.machine import ros
from grader.assignment.load import load_assignment
from grader.batch.batch import Batch, Done
from grader.batch.executor import LocalExecutor
from grader.grading.files import REPORT_FILE
from grader.grading.grading import Grading
from grader.batch.intake import collect
from grader.batch.ledger import Ledger
from grader.findings.finding import Status
from grader.report.model.result import grade_json
from grader.report.model.result import result_json
from grader.report.model.result_model import Result
from grader.run.process.descendants import descendants
from grader.run.runner import Runner
from grader.sandbox.sandbox import Sandbox
from grader.submission.build.toolchain import missing_tools
from tests.attacks.attack import ALIVE, HOLDER, Attack
from tests.attacks.compiled import COMPILED, RIGHT
from tests.attacks.conftest import LESSON

pytestmark = [pytest.mark.ros, pytest.mark.slow]

AT_ONCE = 4

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
faked = [(Odometry, '/odom'), (Clock, '/clock')]
node.fakes = [other.create_publisher(kind, topic, 10) for kind, topic in faked]
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
# One packet: the writer on /cmd_vel announces that it has 2^40 samples.
HEARTBEAT = """\
import socket, struct
writer = bytes(node.get_publishers_info_by_topic('/cmd_vel')[0].endpoint_gid)
udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
number = lambda n: struct.pack('<iI', n >> 32, n & 2**32 - 1)
body = bytes(4) + writer[12:16] + number(2**39) + number(2**40) + struct.pack('<i', 2**30)
packet = b'RTPS\\2\\3\\1\\x0f' + writer[:12] + struct.pack('<BBH', 7, 1, len(body)) + body
for port in (7410, 7411):
    udp.sendto(packet, ('127.0.0.1', port))
"""
# Their parent does not wait for them, so what they take is added to no other process.
RELAY = """\
signal.signal(signal.SIGCHLD, signal.SIG_IGN)
while True:
    for number in range(8):
        if os.fork() == 0:
            while time.process_time() < .3:
                pass
            os._exit(0)
    try:
        os.wait()
    except ChildProcessError:
        pass
"""
CALL = """\
import ctypes, platform
numbers = {{'x86_64': {x86_64}, 'aarch64': {aarch64}}}
assert ctypes.CDLL(None).syscall(numbers[platform.machine()], {arguments}) == -1
"""
PLANT = """\
import os, sys
if 'install' in sys.argv:
    # colcon says so where a package goes.
    share = sys.prefix + '/share'
    os.makedirs(share, exist_ok=True)
    os.path.islink(share + '/passwd') or os.symlink('/etc/passwd', share + '/passwd')
"""
# Deeper than Python recurs, and longer than any path.
DIG = """\
import os
here = os.getcwd()
for place in (here, os.environ['HOME']):
    os.chdir(place)
    for _ in range(1200):
        os.path.isdir('deeper') or os.mkdir('deeper')
        os.chdir('deeper')
os.chdir(here)
"""
HIDDEN_MEMORY = """\
import mmap, time
hoard = mmap.mmap(-1, {mib} * 2**20)
for place in range(0, len(hoard), 2**22):
    hoard[place:place + 2**22] = bytes(2**22)
    hoard.madvise(mmap.MADV_DONTNEED, place, 2**22)
time.sleep(60)
"""
SOCKETS = """\
import socket
hoard = []
for _ in range(3):
    if os.fork() == 0:
        break
while len(hoard) < 350:
    hoard += socket.socketpair()
    hoard[-1].setblocking(False)
    hoard[-1].setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 2**24)
    try:
        while True:
            hoard[-1].send(bytes(2**15))
    except BlockingIOError:
        pass
time.sleep(60)
"""
OTHER_BYTES = """\
node.timer.cancel()
node.other = node.create_timer(.1, lambda: node.publisher.publish(b'\\0\\1\\0\\0abc'))
"""
LOG_BEFORE_TIME = """\
from rcl_interfaces.msg import Log
logs = node.create_publisher(Log, '/rosout', 10)
time.sleep(.3)
record = Log(name='x' * 2**20)
record.stamp.sec = -5
logs.publish(record)
time.sleep(.1)
raise RuntimeError('and now it is graded')
"""
BY_HAND = """\
import socket, struct
writer = bytes(node.get_publishers_info_by_topic('/cmd_vel')[0].endpoint_gid)
udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
for number, stamp in ((node.count + 1, -5), (2**40, 2**31 - 1)):
    body = struct.pack('<HHI', 0, 16, 0) + writer[12:16] + struct.pack('<II', number >> 32, number & 2**32 - 1)
    body += b'\\0\\1\\0\\0' + bytes(48)
    udp.sendto(
        b'RTPS\\2\\3\\1\\x0f' + writer[:12] + struct.pack('<BBHiI', 9, 1, 8, stamp, 2**32 - 1)
        + struct.pack('<BBH', 0x15, 5, len(body)) + body, ('127.0.0.1', 7411))
time.sleep(.1)
raise RuntimeError('and now it is graded')
"""
# rclpy refuses such names by asking a library, which answers here that all is well.
ALLOW_NAMES = """\
import ctypes, platform
codes = {'x86_64': 'c7060000000031c0c3', 'aarch64': '3f0000b900008052c0035fd6'}
for library, function in (
    ('librmw.so', 'rmw_validate_node_name'),
    ('librmw.so', 'rmw_validate_full_topic_name'),
    ('librcl.so', 'rcl_validate_topic_name'),
):
    place = ctypes.cast(getattr(ctypes.CDLL(library), function), ctypes.c_void_p).value
    with open('/proc/self/mem', 'r+b', 0) as memory:
        memory.seek(place)
        memory.write(bytes.fromhex(codes[platform.machine()]))
"""
ODD_NODE = """\
without = dict(start_parameter_services=False, enable_rosout=False)
off = rclpy.parameter.Parameter('start_type_description_service', value=False)
node.other = rclpy.create_node('<b>\\x1b[31m=a b', parameter_overrides=[off], **without)
"""
KILL_COLCON = """\
import os, sys
if 'install' in sys.argv:
    os.kill(os.getppid(), {signal})
"""
SPEAK_AS_COLCON = """\
import sys
if 'install' in sys.argv:
    print('Starting >>> ghost', 'Finished <<< bot_publisher', sep='\\n', flush=True)
    sys.exit(1)
"""
# As if colcon had been cut off in the middle, which would be a fault of the machine.
SPEAK_UNFINISHED = """\
import sys
if 'install' in sys.argv:
    print('Starting >>> bot_publisher', 'and no line end', sep='\\n', end='', flush=True)
    sys.exit(1)
"""
# It knows the lines of the tracer, and writes one for a timer that there is not.
FORGED_TIMER = """\
import json, os, threading, time
import rclpy
from geometry_msgs.msg import Twist

def publish(publisher):
    while rclpy.ok():
        publisher.publish(Twist())
        time.sleep(0.1)

def main():
    rclpy.init()
    node = rclpy.create_node('bot_publisher')
    publisher = node.create_publisher(Twist, '/cmd_vel', 10)
    claim = {'kind': 'timer', 'pid': os.getpid(), 'node': '/bot_publisher', 'period_s': 0.1,
             'callback': 'BotPublisher.tick', 'group': {}}
    os.write(int(os.environ['ROSGRADE_TRACER_FD']), json.dumps(claim).encode() + b'\\n')
    threading.Thread(target=publish, args=(publisher,), daemon=True).start()
    try:
        rclpy.spin(node)
    except KeyboardInterrupt:
        pass
"""
FORGED_DEPTH = FORGED_TIMER.replace(
    "node.create_publisher(Twist, '/cmd_vel', 10)",
    "type(node).create_publisher.__wrapped__(node, Twist, '/cmd_vel', 1)",
).replace(
    "'kind': 'timer'",
    "'kind': 'publisher', 'topic': '/cmd_vel', 'history': 'keep_last', 'depth': 10",
)
UNUSUAL = """\
import asyncio, multiprocessing, socket, tempfile
import numpy
signal.signal(signal.SIGUSR1, lambda *_: None)
signal.raise_signal(signal.SIGUSR1)
os.kill(os.getpid(), signal.SIGUSR1)
os.kill(os.getppid(), 0)
child = subprocess.Popen([sys.executable, '-c', 'input()'], stdin=subprocess.PIPE)
os.kill(child.pid, signal.SIGTERM)
child.wait()
asyncio.run(asyncio.create_subprocess_exec('true'))
# Not forked: a fork beside the threads of DDS may hang.
with multiprocessing.get_context('spawn').Pool(1) as pool:
    assert pool.map(abs, [-1, -2]) == [1, 2]
threads = [threading.Thread(target=sum, args=([1],)) for _ in range(8)]
for thread in threads:
    thread.start()
    thread.join()
numpy.linalg.inv(numpy.random.rand(400, 400)) @ numpy.random.rand(400, 400)
ear = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
ear.bind(('127.0.0.1', 7500))
for _ in range(500):
    ear.sendto(b'not of any middleware', ear.getsockname())
tempfile.TemporaryFile().write(bytes(2**20))
"""
# In a socket that is never read, again and again: they count for all that a user runs.
IN_FLIGHT = """\
import socket, threading, time
def hoard():
    kept = []
    while True:
        try:
            if len(kept) < 200:
                kept += socket.socketpair()
                kept[-1].setblocking(False)
            while True:
                socket.send_fds(kept[-1], [b'x'], [1] * 50)
        except OSError:
            time.sleep(.001)
threading.Thread(target=hoard, daemon=True).start()
"""
HOARD_INOTIFY = """\
import ctypes
while ctypes.CDLL(None).inotify_init() >= 0:
    pass
time.sleep(60)
"""
INJECTION = """\
print('\\x1b[2J\\x1b]0;owned\\x07<script>alert(1)</script>')
raise RuntimeError('<script>alert(2)</script><img src=x onerror=alert(3)>\\x1b[31m=cmd|calc')
"""


# The kernel stops a child when its parent ends: PR_SET_PDEATHSIG, in prctl(2).
STOPPED_BY_AN_END = """\
import ctypes
if os.fork() == 0:
    if os.fork() == 0:
        ctypes.CDLL(None).prctl(1, signal.SIGSTOP)
        while True:
            time.sleep(1)
    time.sleep(.5)
    os._exit(0)
time.sleep(60)
"""
# A terminal of its own, at which Ctrl-Z is typed.
STOPPED_BY_A_TERMINAL = """\
keys, terminal = os.openpty()
name = os.ttyname(terminal)
if os.fork() == 0:
    os.setsid()
    os.open(name, os.O_RDWR)
    job = os.fork()
    if job == 0:
        while True:
            time.sleep(1)
    os.setpgid(job, job)
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)
    os.tcsetpgrp(terminal, job)
    os.write(keys, b'\\x1a')
    while True:
        time.sleep(1)
"""


def ended(attack: str, *named: str) -> Attack:
    """One that ends the node, or for which it is ended."""
    return Attack(attack, lost=ALIVE, named=named)


def unbuilt(at_build: str, *named: str) -> Attack:
    """One that keeps the package from being built."""
    return Attack(at_build=at_build, lost=frozenset({"builds"}), named=named)


def unstarted(at_import: str, *named: str) -> Attack:
    """One that keeps the node from starting."""
    return Attack(at_import=at_import, lost=frozenset({"starts"}), named=named)


ATTACKS = {
    "kills_everything": ended("os.kill(-1, signal.SIGKILL)\nos.kill(os.getpid(), 9)", "SIGKILL"),
    "kills_the_probe": ended(KILL_PROBE, f"sent SIGKILL to {HOLDER}"),
    # It is over before the watchdog looks.
    "kills_the_probe_at_its_end": Attack(
        at_import="import atexit\natexit.register(lambda: os.kill(1, signal.SIGTERM))",
        lost=frozenset({"alive"}),
        named=(f"sent SIGTERM to {HOLDER}",),
    ),
    "traces_the_probe": Attack(
        # PTRACE_ATTACH
        CALL.format(x86_64=101, aarch64=117, arguments="16, os.getppid(), 0, 0"),
        lost=ALIVE,
        named=(f"called `ptrace` on {HOLDER}",),
    ),
    "reads_memory_of_the_probe": ended(
        CALL.format(x86_64=310, aarch64=270, arguments="os.getppid(), None, 0, None, 0, 0"),
        f"called `process_vm_readv` on {HOLDER}",
    ),
    "loads_a_program_into_the_kernel": ended(
        CALL.format(x86_64=321, aarch64=280, arguments="0, 0, 0"), "called `bpf`"
    ),
    "fork_bomb": ended(BOMB, "sessions"),
    "heap": Attack(
        # Pages that are never touched: the limit is reached at once, however busy the machine is.
        "x = []\nwhile True:\n    x.append(bytes(2**24))",
        lost=frozenset({"messages"}),
        # A program that ran out of memory cannot always end itself.
        maybe=frozenset({"alive", "ends"}),
        named=("MemoryError",),
    ),
    "memory_of_many": ended(MANY_HOGS, "MiB of memory"),
    "shared_memory_map": ended(
        "import mmap\nm = mmap.mmap(-1, 3 * 2**30)\nfor i in range(0, len(m), 4096):\n    m[i] = 1",
        "MiB of memory",
    ),
    "fills_the_disk": ended(
        "for i in range(9):\n    open(f'/tmp/{i}', 'wb').write(bytes(2**22))",
        "No space left on device",
        "all space in /tmp and home",
    ),
    "one_huge_file": ended(
        "signal.signal(signal.SIGXFSZ, signal.SIG_IGN)\n"
        "os.truncate(os.open('/tmp/x', os.O_CREAT | os.O_RDWR), 2**40)",
        "File too large",
    ),
    "a_million_files": ended(
        "for i in range(10**6):\n    open(f'/tmp/{i}', 'w').close()", "No space left on device"
    ),
    "fills_shared_memory": ended(
        "open('/dev/shm/x', 'wb').write(bytes(2**25 - 2**20))", "No space left"
    ),
    "endless_output": ended(
        "block = b'spam ' * 2**15\nwhile True:\n    os.write(1, block)", "MiB of output"
    ),
    "daemon": Attack(DAEMON, lost=frozenset({"ends"}), named=("86397",)),
    "ignores_signals": Attack(
        "for n in (2, 15, 1):\n    signal.signal(n, signal.SIG_IGN)\n"
        "while True:\n    node.tick() or time.sleep(.1)",
        lost=frozenset({"ends", "timer"}),
        named=("SIGKILL",),
    ),
    "hides_shared_memory": ended(HIDDEN_MEMORY.format(mib=600), "MiB of memory"),
    "memory_in_sockets": ended(SOCKETS, "open files, 1024 are allowed"),
    "hoards_descriptors_in_flight": Attack(
        at_import=IN_FLIGHT,
        maybe=frozenset({"alive", "starts", "messages"}),
        named=("more than 64 descriptors on their way between processes",),
    ),
    "hoards_asynchronous_io": ended(
        CALL.format(x86_64=206, aarch64=0, arguments="65536, ctypes.byref(ctypes.c_ulong())"),
        "called `io_setup`",
    ),
    "hoards_inotify": ended(HOARD_INOTIFY, "called `inotify_init` more than 8 times"),
    "writes_into_the_init": ended("os.open('/proc/1/mem', os.O_RDWR)", "FileNotFoundError"),
    "publishes_other_bytes": Attack(
        OTHER_BYTES, lost=frozenset({"messages"}), named=("cannot be read",)
    ),
    "logs_before_1970": ended(LOG_BEFORE_TIME, "and now it is graded"),
    "writes_packets_by_hand": ended(BY_HAND, "and now it is graded"),
    "names_a_node_past_rclpy": Attack(
        ODD_NODE,
        at_import=ALLOW_NAMES,
        lost=frozenset({"alive"}),
        maybe=frozenset({"messages"}),
        named=("with a name that ROS does not allow",),
    ),
    "stops_itself": ended("os.kill(os.getpid(), signal.SIGSTOP)", "SIGSTOP"),
    "is_stopped_by_the_end_of_its_parent": ended(STOPPED_BY_AN_END, "with SIGSTOP"),
    "is_stopped_at_its_own_terminal": Attack(
        STOPPED_BY_A_TERMINAL,
        lost=frozenset({"alive"}),
        maybe=frozenset({"messages"}),
        named=("with SIGSTOP",),
    ),
    "sleeps": unstarted("time.sleep(1000)"),
    "leaves_at_once": unstarted("os._exit(0)"),
    "another_domain": unstarted("os.environ['ROS_DOMAIN_ID'] = '5'", "joined ROS domain 5"),
    "another_discovery_server": unstarted(
        "os.environ['ROS_DISCOVERY_SERVER'] = '127.0.0.1:11811'",
        "the program changed ROS_DISCOVERY_SERVER",
    ),
    "calls_its_node_otherwise_than_it_says": Attack(
        at_import="Node.get_name = lambda _: 'bot_publisher'",
        name="publisher_bot",
        lost=frozenset({"node"}),
        named=("found the node `/publisher_bot`",),
    ),
    "hides_what_python_has": unstarted(
        "if sys.flags.no_site == 0:\n"
        "    os.execv(sys.executable, [sys.executable, '-S', *sys.argv])"
    ),
    "shuts_the_tracer_out": Attack(
        at_import="import posix\nposix.close(int(os.environ['ROSGRADE_TRACER_FD']))",
        lost=frozenset({"timer"}),
        named=("the process did not declare the publisher",),
    ),
    "declares_a_timer_beside_a_thread": Attack(
        files={"bot_publisher/node.py": FORGED_TIMER},
        lost=frozenset({"timer"}),
        named=("outside of every callback",),
    ),
    "declares_another_depth": Attack(
        files={"bot_publisher/node.py": FORGED_DEPTH},
        lost=frozenset({"depth", "timer"}),
        named=("the heartbeats of the publisher show that it keeps 1 message",),
    ),
    "forged_tracer": ended(FORGED, "wrote into the channel"),
    "squats_the_probe_s_name": Attack(
        SQUAT,
        lost=frozenset({"untouched"}),
        named=("is called `/rosgrade_probe`, like the node", "publishes on `/clock` and `/odom`"),
    ),
    "is_called_as_the_probe": Attack(name="rosgrade_probe", lost=frozenset({"node", "untouched"})),
    "floods_topics_and_rosout": Attack(
        FLOOD_TOPICS,
        lost=frozenset({"messages"}),
        named=("messages were sent on `/cmd_vel` within 1 s",),
    ),
    "garbage_on_dds_ports": ended(GARBAGE, "sent garbage to the UDP ports"),
    "announces_endless_samples": Attack(
        HEARTBEAT,
        lost=frozenset({"starts"}),
        named=("keep the middleware of the node that watches the run busy",),
    ),
    "burns_the_cpus_in_turns": ended(RELAY, "s of CPU time, 3 s are allowed"),
    "injection": ended(INJECTION, "RuntimeError"),
    "shadows_modules": Attack(
        files={
            "numpy/__init__.py": "raise SystemExit('trojan')",
            "yaml/__init__.py": "raise SystemExit('trojan')",
        },
        lost=frozenset({"starts"}),
    ),
    "build_fork_bomb": unbuilt(BOMB, "it started 64 processes"),
    "build_plants_links": unbuilt(PLANT, "'share/passwd', a link out to '/etc/passwd'"),
    "build_digs_deep": unbuilt(DIG, "it nested folders more than 100 deep"),
    "build_installs_outside": unbuilt(
        "import setuptools\n_s = setuptools.setup\ndef setup(**k):\n"
        "    k['data_files'].append(('/etc/cron.d', ['package.xml']))\n    _s(**k)\n"
        "setuptools.setup = setup"
    ),
    "build_kills_colcon": unbuilt(
        KILL_COLCON.format(signal=9), "PermissionError: [Errno 1] Operation not permitted"
    ),
    "build_writes_into_colcon": unbuilt(
        "import os\nopen(f'/proc/{os.getppid()}/mem', 'r+b')",
        "PermissionError: [Errno 13] Permission denied",
    ),
    # No signal, though a shell would tell of one so.
    "build_ends_as_if_killed": unbuilt(
        "import sys\nif 'install' in sys.argv:\n    sys.exit(137)", "exited with code 137"
    ),
    "build_speaks_as_colcon": unbuilt(SPEAK_AS_COLCON, "setup.py: Finished"),
    "build_speaks_without_a_line_end": unbuilt(SPEAK_UNFINISHED, "setup.py: and no line end"),
    "build_hides_memory": unbuilt(
        HIDDEN_MEMORY.format(mib=1200), "it took more than 1024 MiB of memory"
    ),
    "build_memory": unbuilt("x = bytearray(2**32)", "MemoryError"),
    "build_disk": unbuilt(
        "import os\nfor i in range(40):\n"
        "    open(f'{os.environ[\"HOME\"]}/{i}', 'wb').write(bytes(2**26))",
        "it wrote more than 128 MiB",
    ),
    "build_output": unbuilt(
        "import sys\nwhile True:\n    sys.stderr.write('spam ' * 10**5)", "too much output"
    ),
    **COMPILED,
}


HONEST = {
    "right": Attack(),
    "right_in_cpp": RIGHT,
    "misnamed": Attack(name="publisher_bot", lost=frozenset({"node"})),
    "stops_too_early": Attack("node.timer.cancel()", lost=frozenset({"messages"})),
    "crashes": ended("raise ValueError('a mistake')"),
    "uses_what_is_allowed": Attack(at_import="import scipy"),
    "names_a_module_that_is_no_text": Attack(
        files={"bot_publisher/other.py": "import importlib\nimportlib.import_module('\\ud800')"}
    ),
    "does_unusual_things": Attack(UNUSUAL),
    "closes_all_that_it_did_not_open": Attack(at_import="os.closerange(3, 65536)"),
    "starts_python_anew": Attack(
        at_import="if 'ANEW' not in os.environ:\n"
        "    os.execve(sys.executable, [sys.executable, *sys.argv], {**os.environ, 'ANEW': ''})"
    ),
    "uses_what_is_not": unstarted(
        "import pydantic",
        "No module named 'pydantic'",
        "Python does not find this module: check its spelling",
        "numpy and the libraries that your course allows",
    ),
    "does_not_build": unbuilt("raise ValueError('a mistake')"),
}
"""Right and wrong, without any bad intent."""

OPEN_FILES = 1024
USER = 61_500
BESIDE_HOARDS = (
    "right",
    "misnamed",
    "stops_too_early",
    "crashes",
    "does_unusual_things",
    "does_not_build",
)
HOARDS = {name: attack for name, attack in ATTACKS.items() if "hoards" in name}
HOARDS |= {f"hoards_{number}": ATTACKS["hoards_descriptors_in_flight"] for number in range(3)}
HOARDS |= {"writes_into_the_init": ATTACKS["writes_into_the_init"]}
HOARDS |= {name: attack for name, attack in ATTACKS.items() if name.startswith("is_stopped")}


@dataclass(frozen=True)
class Handed:
    """What came of a submission in a batch: all that an instructor gets of it."""

    result: Result
    page: str

    @property
    def told(self) -> str:
        """All that is said of it."""
        return html.unescape(self.page) + result_json(self.result)

    @property
    def failed(self) -> set[str]:
        """Checks that cost points by themselves."""
        return {check.id for check in self.result.checks if check.status is Status.FAILED}

    def __str__(self) -> str:
        """What a failing test shows."""
        lines = [
            f"{check.id} {check.status.value}: {check.observed} {check.evidence.log[-5:]}"
            for check in self.result.checks
            if check.status is not Status.PASSED
        ]
        build = self.result.build
        lines += [f"{run.ending} {run.breaches} {run.faults}" for run in self.result.scenarios]
        return "\n".join([*lines, build.log[-500:] if build and not build.succeeded else ""])


def grade_class(folder: Path, members: dict[str, Attack], sandbox: Sandbox) -> dict[str, Handed]:
    """Grade a class as `rosgrade batch` does, in an order of its own, with no build cached."""
    submissions, staging = folder / "class", folder / "staging"
    staging.mkdir(parents=True)
    for name, member in members.items():
        member.write(submissions / name)
    rows = collect(submissions, staging)
    random.Random(1).shuffle(rows)
    loaded = load_assignment(LESSON)
    with (
        Runner(ros.find(), sandbox=sandbox) as runner,
        Ledger(folder / "out").opened() as ledger,
    ):
        batch = Batch(loaded, ledger)
        executor = LocalExecutor(Grading(loaded, runner, folder / "cache"), AT_ONCE)
        try:
            done = list(batch.grade(batch.read(rows)[1], executor))
        finally:
            executor.close()
        assert {item.entry.key for item in done} == set(members)
        return {item.entry.key: _handed(item, ledger) for item in done}


def _handed(done: Done, ledger: Ledger) -> Handed:
    result = ledger.whole_result(done.entry.key)
    assert result is not None, done.entry
    page = (ledger.folder(done.entry.key) / REPORT_FILE).read_text(encoding="utf-8")
    return Handed(result, page)


def possible(members: dict[str, Attack]) -> dict[str, Attack]:
    """Those that can be built on this machine."""
    compiles = not missing_tools(os.environ["PATH"])
    return {name: one for name, one in members.items() if compiles or not one.compiled}


def named(members: dict[str, Attack]) -> list[Any]:
    """The names, as parameters."""
    return [
        pytest.param(name, marks=[pytest.mark.compiles] if one.compiled else [])
        for name, one in members.items()
    ]


@pytest.fixture(scope="module")
def calm(sandbox: Sandbox, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Handed]:
    """The honest ones among themselves."""
    return grade_class(tmp_path_factory.mktemp("calm"), possible(HONEST), sandbox)


@pytest.fixture(scope="module")
def graded(sandbox: Sandbox, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Handed]:
    """The same honest ones, with all the others among them."""
    return grade_class(tmp_path_factory.mktemp("hostile"), possible({**HONEST, **ATTACKS}), sandbox)


@pytest.mark.parametrize("name", named(ATTACKS))
def test_an_attack_costs_its_own_points_and_is_named(name: str, graded: dict[str, Handed]) -> None:
    attack, handed = ATTACKS[name], graded[name]
    assert attack.lost <= handed.failed <= attack.lost | attack.maybe, str(handed)
    assert handed.result.graded, str(handed)
    for text in attack.named:
        assert text in handed.told, str(handed)
    assert handed.result.score is not None and handed.result.score < handed.result.max_score


@pytest.mark.parametrize("name", named(HONEST))
def test_an_honest_grade_is_the_same_byte_for_byte(
    name: str, calm: dict[str, Handed], graded: dict[str, Handed]
) -> None:
    assert calm[name].failed == HONEST[name].lost, str(calm[name])
    for text in HONEST[name].named:
        assert text in calm[name].told, str(calm[name])
    assert grade_json(graded[name].result) == grade_json(calm[name].result), str(graded[name])


def test_nothing_is_left_running(graded: dict[str, Handed]) -> None:
    # A process that outlived its parent in a namespace still descends from the namespace's maker.
    commands = descendants(os.getpid()).values()
    assert not [line for line in commands if re.search("86397|bot_pub|setup.py", line)]


def test_what_it_prints_is_shown_and_never_executed(graded: dict[str, Handed]) -> None:
    page = graded["injection"].page
    assert "alert(2)" in page
    assert "<script>alert" not in page and "<img src=x" not in page
    assert "\x1b" not in page


def bound() -> None:
    resource.setrlimit(resource.RLIMIT_NOFILE, (OPEN_FILES, OPEN_FILES))


def as_a_user(folder: Path) -> list[str]:
    """What to start a program with, so that it does not run as root; empty where it need not."""
    drop = ["setpriv", f"--reuid={USER}", f"--regid={USER}", "--clear-groups"]
    tried = [*drop, sys.executable, "-c", "import os, sys; os.stat(sys.executable)"]
    if os.geteuid() != 0 or subprocess.run(tried, capture_output=True, check=False).returncode:
        return []
    for place in (folder, *folder.parents):
        if place.owner() == "root" and place != Path("/tmp"):
            place.chmod(place.stat().st_mode | 0o055)
        if place.name.startswith("pytest-of"):
            break
    os.chown(folder, USER, USER)
    return drop


def test_six_honest_grades_are_the_same_bits_beside_submissions_that_hoard(
    calm: dict[str, Handed], tmp_path: Path
) -> None:
    members = (*BESIDE_HOARDS, *HOARDS)
    done = subprocess.run(
        [*as_a_user(tmp_path), sys.executable, "-m", __name__, str(tmp_path), *members],
        preexec_fn=bound,
        env={**os.environ, "HOME": str(tmp_path)},
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        check=False,
        timeout=600,
    )
    assert done.returncode == 0, done.stderr
    beside: dict[str, str] = json.loads(done.stdout.splitlines()[-1])
    for name in BESIDE_HOARDS:
        assert beside[name] == grade_json(calm[name].result)
    for name, attack in HOARDS.items():
        assert all(text in beside[name] for text in attack.named), (name, beside[name])


def main(folder: str, *names: str) -> None:
    """Grade some of the submissions, and print what came of each."""
    known, place = {**HONEST, **HOARDS}, Path(folder, "graded")
    members = {name: known[name] for name in names}
    handed = grade_class(place, members, Sandbox(place / "cache"))
    told = {
        name: grade_json(one.result) if name in HONEST else one.told for name, one in handed.items()
    }
    print(json.dumps(told))


if __name__ == "__main__":
    main(*sys.argv[1:])
