"""The catalogue: every check is there, documented, and never breaks on what a student sends."""

import json
import math
import subprocess
import sys
from functools import cache
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from grader import checks
from grader.checks.catalogue import CATALOGUE, gather
from grader.checks.check import Check, Subject
from grader.findings.finding import Finding, Status
from grader.recording.model import (
    Call,
    Declaration,
    Ending,
    Endpoint,
    Kind,
    LogLine,
    Message,
    Node,
    Owner,
    Process,
    Qos,
    Recording,
)
from grader.recording.simulated import Incident, Scene, Truth
from sim.motion import ORIGIN, Pose
from sim.shapes import MovingObstacle, Waypoint
from tests.checks.builder import (
    CHECKS,
    LAUNCH_NS,
    TWIST,
    died,
    drive,
    judge,
    on_odometry,
    recording,
    submission,
    twist,
)

INTERFACE = "bot_publisher/msg/BotStatus"
GOAL = [1.0, 0.0, "0 deg"]
PARAMETERS = {
    "package.found": {"package": "bot_publisher", "build_type": "ament_python"},
    "package.builds": {"package": "bot_publisher"},
    "package.dependencies": {"package": "bot_publisher"},
    "package.executable": {"package": "bot_publisher", "executable": "bot_pub"},
    "interface.found": {"interface": INTERFACE},
    "interface.fields": {"interface": INTERFACE, "definition": "uint8 model"},
    "interface.constants": {"interface": INTERFACE, "definition": "uint8 ON=1"},
    "interface.generated": {"interface": INTERFACE},
    "interface.manifest": {"interface": INTERFACE},
    "source.class": {"package": "bot_publisher"},
    "source.docstrings": {"package": "bot_publisher"},
    "source.type_hints": {"package": "bot_publisher"},
    "source.no_print": {"package": "bot_publisher"},
    "source.ruff": {"package": "bot_publisher", "rules": ["F", "E501"]},
    "node.starts": {},
    "node.exists": {"name": "bot_publisher"},
    "node.alive": {"name": "bot_publisher"},
    "node.ends": {"within": "2 s"},
    "node.finishes": {},
    "topic.published": {"topic": "/cmd_vel"},
    "topic.subscribed": {"topic": "/cmd_vel"},
    "topic.type": {"topic": "/cmd_vel", "type": TWIST},
    "qos.offered": {"topic": "/cmd_vel", "reliability": "reliable", "deadline": "1 s"},
    "qos.requested": {"topic": "/cmd_vel", "durability": "volatile"},
    "qos.depth": {"topic": "/cmd_vel", "depth": 10},
    "qos.compatible": {"topic": "/cmd_vel", "kind": "publisher", "reliability": "reliable"},
    "qos.late_joiner": {"topic": "/cmd_vel", "joiner": "late", "last": 0},
    "messages.count": {"topic": "/cmd_vel", "at_least": 3, "at_most": 20},
    "messages.equal": {"topic": "/cmd_vel", "value": {"linear": {"x": 1.0}, "angular.z": 0.5}},
    "messages.follows": {
        "topic": "/cmd_vel",
        "source": "/odom",
        "fields": {"linear.x": "twist.twist.linear.x"},
        "tolerance": 0.01,
    },
    "messages.sequence": {"topic": "/cmd_vel", "field": "linear.x", "step": 0, "start": 1},
    "timing.period": {"topic": "/cmd_vel", "period": "300 ms"},
    "timing.rate": {"topic": "/cmd_vel", "at_least": "3 Hz", "at_most": "4 Hz"},
    "timing.latency": {"stimulus": "/chatter", "topic": "/cmd_vel", "median": "50 ms"},
    "callbacks.run": {"topic": "/cmd_vel", "callbacks": ["timer_1"], "period": "1 s"},
    "callbacks.work": {"topic": "/cmd_vel", "callbacks": ["timer_1"], "duration": "400 ms"},
    "callbacks.never_overlap": {"topic": "/cmd_vel", "callbacks": ["timer_1"]},
    "callbacks.overlap": {"topic": "/cmd_vel", "callbacks": ["timer_1"], "others": ["timer_2"]},
    "callbacks.together": {"topic": "/cmd_vel", "callbacks": ["timer_1", "timer_2"]},
    "rotation.answers": {
        "stimulus": "/rpy",
        "topic": "/cmd_vel",
        "conversion": "rpy_to_quaternion",
    },
    "executor.responsive": {"within": "1 s"},
    "executor.timer": {"topic": "/cmd_vel"},
    "motion.drives": {"speed": "0.22 m/s", "tolerance": "5 %"},
    "motion.keeps_driving": {"distance": "0.5 m"},
    "motion.straight": {},
    "motion.stops": {"distance": "0.8 m"},
    "motion.stays_at_rest": {"after": "stop"},
    "motion.no_contact": {},
    "motion.reaches": {"goal": GOAL, "position": "5 cm", "heading": "3 deg"},
    "motion.settles": {"within": "10 s"},
    "motion.path_length": {"goal": GOAL, "most": "10 %"},
    "motion.overshoot": {"goal": GOAL, "most": "2 cm"},
    "motion.two_phases": {"goal": GOAL, "position": "5 cm"},
    "motion.short_way": {"goal": GOAL},
    "motion.proportional": {"goal": GOAL, "phase": "align"},
    "motion.proportional_speed": {"goal": GOAL},
    "motion.within_limits": {},
    "motion.slows_down": {"share": "100 %"},
    "topic.untouched": {},
    "topic.not_subscribed": {"topics": ["/scan"]},
    "log.follows": {"topic": "/cmd_vel", "fields": ["linear.x", "angular.z"]},
    "log.contains": {"text": "ready", "level": "INFO"},
    "log.level": {"at_most": "WARN"},
    "log.rate": {"text": "ready", "rate": "1 Hz"},
    "service.exists": {"service": "/enable", "type": "std_srvs/srv/SetBool"},
    "service.responds": {"service": "/enable", "response": {"success": True}},
    "service.concurrent": {"service": "/enable", "takes": "400 ms"},
    "action.exists": {"action": "/fibonacci"},
    "action.rejects": {"action": "/fibonacci", "goal": {"order": -1}},
    "action.feedback": {"action": "/fibonacci", "at_least": 3, "rate": "10 Hz"},
    "action.result": {"action": "/fibonacci", "result": {"sequence": [0, 1]}, "within": "2 s"},
    "action.cancels": {"action": "/fibonacci"},
    "action.preempts": {"action": "/fibonacci"},
    "parameter.declared": {"node": "bot_publisher", "name": "speed", "default": 0.5},
    "parameter.set": {"node": "bot_publisher", "name": "speed", "value": 0.9},
    "parameter.takes_effect": {
        "node": "bot_publisher",
        "name": "speed",
        "value": 0.9,
        "topic": "/cmd_vel",
        "fields": {"linear.x": 0.9},
    },
    "lifecycle.state": {"node": "bot_publisher", "states": ["unconfigured", "active"]},
}
ABSENT = {
    "interface.found",
    "interface.fields",
    "interface.constants",
    "interface.generated",
    "interface.manifest",
    "messages.follows",
    "topic.subscribed",
    "qos.requested",
    "qos.offered",
    "log.follows",
    "timing.latency",
    "rotation.answers",
    "qos.late_joiner",
    "log.contains",
    "log.rate",
    "lifecycle.state",
    *(name for name in PARAMETERS if name.startswith(("service.", "action.", "parameter."))),
    *(name for name in PARAMETERS if name.startswith("callbacks.")),
    # A record without source files cannot pass.
    *(name for name in PARAMETERS if name.startswith("source.")),
}


def subject_of(name):
    if name.startswith("motion."):
        return ahead_to_the_goal()
    if name == "node.finishes":
        return recording(processes=(died(0),), ending=Ending.EXITED)
    return submission() if CHECKS[name].subject is Subject.SUBMISSION else recording()


@cache
def ahead_to_the_goal():
    """A robot that drives straight to the goal and stops there, in front of a wall."""
    return drive(
        on_odometry(lambda pose: (0.22 if pose.x_m < 0.97 else 0.0, 0.0)),
        world="{segments: [[1.8, -1, 1.8, 1]]}",
    )


def test_every_check_is_tried_here_or_in_a_test_of_its_own():
    assert set(PARAMETERS) <= set(CHECKS)
    texts = [file.read_text() for file in Path(__file__).parents[1].rglob("test_*.py")]
    for name in set(CHECKS) - set(PARAMETERS):
        assert any(f'"{name}"' in text for text in texts), f"{name} has no test"


def test_every_check_that_is_defined_is_found_by_its_family():
    modules = [
        import_module(module.name)
        for module in walk_packages(checks.__path__, f"{checks.__name__}.")
    ]
    defined = {
        item.name for module in modules for item in vars(module).values() if isinstance(item, Check)
    }
    assert {name for name in defined if name in CATALOGUE} == defined == set(CATALOGUE)


def test_an_assignment_without_rotations_does_not_wait_for_numpy():
    code = (
        "import sys; from grader.assignment.load import load_assignment; "
        "load_assignment('timed_publisher'); assert 'numpy' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("name", sorted(set(PARAMETERS) - ABSENT))
def test_a_good_submission_passes(name):
    finding = judge(name, subject_of(name), **PARAMETERS[name])
    assert finding.status is Status.PASSED, finding
    assert finding.credit == 1.0
    assert finding.expected and finding.observed


@pytest.mark.parametrize("name", sorted(PARAMETERS))
def test_the_documentation_is_for_students(name):
    check = CHECKS[name]
    title = check.documentation.splitlines()[0]
    assert title.endswith(".") and len(title) <= 70
    assert check.title == title[:-1]


@pytest.mark.parametrize("name", sorted(PARAMETERS))
def test_every_parameter_is_described(name):
    for field in CHECKS[name].parameters.model_fields.values():
        assert field.description and field.description.endswith((".", "`)."))


@pytest.mark.parametrize("name", sorted(PARAMETERS))
def test_parameters_have_a_json_schema(name):
    schema = CHECKS[name].parameters.model_json_schema()
    assert json.loads(json.dumps(schema))["additionalProperties"] is False


@pytest.mark.parametrize("name", sorted(PARAMETERS))
def test_a_parameter_that_does_not_exist_is_refused(name):
    with pytest.raises(ValueError, match="Extra inputs are not permitted"):
        judge(name, subject_of(name), **PARAMETERS[name], tolerence=1)


def test_the_catalogue_cannot_be_changed():
    with pytest.raises(TypeError):
        CATALOGUE["x"] = CATALOGUE["node.exists"]


def test_two_checks_of_one_name_are_refused():
    from grader.checks.node import node

    with pytest.raises(ValueError, match="two checks are called"):
        gather((node, node))


NAMES = st.sampled_from(["/bot_publisher", "/Bot", "/a/bot_publisher", "/x"])
TOPICS = st.sampled_from(["/cmd_vel", "/cmdvel", "/bot_publisher/cmd_vel", "/rosout", "/a/b"])
TIMES = st.integers(-(10**9), 10**10).map(lambda ns: LAUNCH_NS + ns)
MAYBE = st.one_of(st.none(), TIMES)
PROCESSES = st.sampled_from(["bot_publisher/bot_pub", "p/other"])
JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=9)),
    lambda inner: st.one_of(st.lists(inner, max_size=2), st.dictionaries(st.text(), inner)),
    max_leaves=4,
)
DECLARATIONS = st.builds(
    Declaration,
    TIMES,
    PROCESSES,
    st.sampled_from(
        ["started", "init", "node", "publisher", "timer", "spin", "held", "ran", "exiting", "?"]
    ),
    st.dictionaries(
        st.sampled_from(["topic", "depth", "history", "period_s", "node", "matched"]),
        st.one_of(JSON, TOPICS),
    ),
)
QOS = st.builds(
    Qos,
    reliability=st.sampled_from(["reliable", "best_effort", "unknown"]),
    durability=st.sampled_from(["volatile", "transient_local", "unknown"]),
    deadline_s=st.one_of(st.none(), st.floats(0, 9)),
)
ENDPOINTS = st.builds(
    Endpoint,
    st.sampled_from(list(Kind)),
    TOPICS,
    st.sampled_from([TWIST, "geometry_msgs/msg/Vector3", "x/msg/Twist"]),
    NAMES,
    st.sampled_from(list(Owner)),
    QOS,
    st.just("00"),
    TIMES,
    MAYBE,
)
NUMBERS = st.floats(allow_nan=True, allow_infinity=True)
MESSAGES = st.lists(
    st.builds(
        Message,
        st.just("/cmd_vel"),
        st.just(TWIST),
        st.builds(lambda x, z: twist((x, 0, 0), (0, 0, z)), NUMBERS, NUMBERS),
        st.one_of(TIMES, st.integers(0, 2**63 - 1)),
        TIMES,
        st.integers(0, 2**64 - 1),
    ),
    max_size=14,
).map(lambda found: {"/cmd_vel": tuple(sorted(found, key=lambda m: m.stamp_ns))} if found else {})
POINTS = st.floats(-3, 3)
TRUTH = st.builds(
    lambda steps, contact: tuple(
        Truth(LAUNCH_NS + 10**7 * index, *step, contact if index == 1 else None)
        for index, step in enumerate(steps)
    ),
    st.lists(st.tuples(*[POINTS] * 7), max_size=6),
    st.sampled_from([None, "boxes[0]", "moving[0]"]),
)
SCENES = st.builds(
    Scene,
    radius_m=st.just(0.1),
    max_linear_m_s=st.just(0.22),
    max_angular_rad_s=st.just(2.84),
    outlines=st.just(
        {"boxes[0]": ((1.0, -1.0, 1.0, 1.0, 0.0),), "circles[0]": ((0, 1, 0, 1, 0.1),)}
    ),
    moving=st.just(
        (
            MovingObstacle("moving[0]", (Waypoint(0, Pose(0.5, 0.0, 0.0)),), radius_m=0.1),
            MovingObstacle(
                "moving[1]", (Waypoint(0, ORIGIN),), size_m=(0.2, 0.1), appears_ns=20_000_000
            ),
        )
    ),
    began_ns=st.just(LAUNCH_NS),
    lidar=st.sampled_from([ORIGIN, Pose(-0.03, 0.01, 3.0)]),
)
SENSED = st.builds(
    lambda topic, value, time: (topic, Message(topic, "x/msg/X", value, time, time, 1)),
    st.sampled_from(["/odom", "/scan"]),
    st.one_of(
        st.dictionaries(st.sampled_from(["ranges", "angle_min", "header", "pose"]), JSON),
        st.just({"ranges": [0.0, math.inf, math.nan], "angle_min": 0.0, "angle_increment": 2.1}),
    ),
    TIMES,
)
INCIDENTS = st.builds(
    Incident,
    TIMES,
    st.sampled_from(["late", "command_rejected", "contact_began"]),
    st.sampled_from(["3 steps done 25 ms late", "linear nan, angular 0.0", ""]),
    st.one_of(st.none(), st.floats(0.0, 10.0)),
)
LOG = st.builds(
    LogLine,
    TIMES,
    PROCESSES,
    st.sampled_from(["stdout", "stderr", "rosout"]),
    st.one_of(
        st.text(max_size=20),
        st.sampled_from(
            [
                "Traceback (most recent call last):",
                '  File "/x/site-packages/bot_publisher/node.py", line 3, in main',
                "    self.publisher.publish(x)",
                "ValueError: x",
                "KeyboardInterrupt",
                "Publishing",
            ]
        ),
    ),
)
RECORDINGS = st.builds(
    Recording,
    scenario=st.just("s"),
    seed=st.just(1),
    ending=st.sampled_from(list(Ending)),
    launched_ns=st.just(LAUNCH_NS),
    stop_ns=TIMES,
    end_ns=TIMES,
    submission=st.just(submission()),
    matched_ns=MAYBE,
    messages=st.builds(
        lambda sent, sensed: {**sent, **{topic: (item,) for topic, item in sensed}},
        MESSAGES,
        st.lists(SENSED, max_size=2),
    ),
    truth=TRUTH,
    scenes=st.dictionaries(st.sampled_from(["", "tb1"]), SCENES, max_size=2),
    incidents=st.lists(INCIDENTS, max_size=2).map(tuple),
    nodes=st.lists(
        st.builds(Node, NAMES, st.sampled_from(list(Owner)), TIMES, MAYBE), max_size=3
    ).map(tuple),
    endpoints=st.lists(ENDPOINTS, max_size=4).map(tuple),
    processes=st.lists(
        st.builds(
            Process,
            PROCESSES,
            st.just(1),
            TIMES,
            MAYBE,
            st.one_of(st.none(), st.integers(-70, 300)),
            st.sampled_from(["itself", "SIGINT", "SIGTERM", "SIGKILL"]),
            st.one_of(st.none(), st.floats(0, 9)),
        ),
        max_size=2,
    ).map(tuple),
    log=st.lists(LOG, max_size=12).map(tuple),
    declarations=st.lists(DECLARATIONS, max_size=6).map(tuple),
    calls=st.lists(
        st.builds(Call, NAMES.map(lambda n: f"{n}/list_parameters"), st.just("x"), TIMES, MAYBE),
        max_size=5,
    ).map(tuple),
)


@settings(max_examples=300, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(RECORDINGS)
def test_no_recording_breaks_a_check(run):
    for name, parameters in PARAMETERS.items():
        if CHECKS[name].subject is Subject.RECORDING:
            finding = judge(name, run, **parameters)
            assert isinstance(finding, Finding)
            assert finding.expected and finding.observed
            assert (finding.credit == 1.0) == (finding.status is Status.PASSED)
