"""Each explanation of the catalogue answers for a run or a submission of its own."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest

from grader.diagnosis import explanation
from grader.diagnosis.explanation import Symptom, explanations
from grader.recording.event import Breach
from grader.recording.model import Ending, Kind, Recording
from grader.recording.submission import (
    BuildRecord,
    SourceClass,
    SourceError,
    SourceFile,
    SourceFunction,
)
from tests.checks import builder
from tests.checks.builder import (
    NODE,
    RELIABLE,
    call,
    deaf,
    declarations,
    declared,
    died,
    endpoint,
    every,
    judge,
    messages,
    node,
    nodeless,
    output,
    package,
    process,
    reader,
    recording,
    sent,
    silent,
    stimulus,
    submission,
    taken,
    traceback,
    twist,
)
from tests.checks.requests import (
    acting,
    asked,
    asking,
    canceled,
    parameters_read,
    service,
    serving,
    to_service,
)
from tests.checks.test_interface import CMAKE, INTERFACE, handed_in, unbuilt
from tests.checks.test_package import NEEDS_NAV2
from tests.diagnosis import motion_cases
from tests.diagnosis.motion_cases import Group

STRING = "std_msgs/msg/String"
LATCHED = replace(RELIABLE, durability="transient_local")
LISTENER = endpoint("/chatter", kind=Kind.SUBSCRIPTION, type=STRING)
EXITED = {"ending": Ending.EXITED}
NOT_STARTED = {"ending": Ending.NOT_STARTED, "processes": ()}
BUSY = taken(0.1, 4.4, waited_s=4.2)
FAILED_BUILD = BuildRecord(
    False, 1.0, failed_packages=("bot_publisher",), log="Starting >>> bot_publisher\n"
)
HANGS = tuple(call(0.5 * n, None) for n in range(2, 6))


@contextmanager
def answers() -> Iterator[set[str]]:
    """The names of the explanations that answered meanwhile, each with that of its symptom."""
    names: set[str] = set()

    def recorded(entry: explanation.Explanation) -> explanation.Explanation:
        def apply(symptom: Symptom[Any]) -> Any:
            answer = entry.apply(symptom)
            if answer is not None:
                names.add(f"{type(symptom).__name__}.{entry.name}")
            return answer

        return replace(entry, apply=apply)

    entries = {symptom: tuple(map(recorded, found)) for symptom, found in explanations().items()}
    with patch.object(explanation, "explanations", lambda: entries):
        yield names


def gone(item: Any, time_s: float = 0.9) -> Any:
    return replace(item, vanished_ns=recording().launched_ns + round(time_s * 1e9))


def answering(*listeners: Any, times_s: Any = (), **changes: Any) -> Recording:
    """A node that should answer on /cmd_vel what it is sent on /chatter, and does not."""
    found = {
        "messages": {},
        "sent": sent(times_s),
        "answers": {"/chatter": "/cmd_vel"},
        "endpoints": (endpoint(), *listeners, reader(), stimulus()),
        "declarations": declarations(timer_s=None),
    }
    return recording(**{**found, **changes})


def logging(*lines: str, **changes: Any) -> Recording:
    """A node that is sent five numbers on /chatter, and writes these lines after each."""
    times_s = every(0.3, 5, 1.0)
    log = tuple(one for t in times_s for text in lines for one in output(text, time_s=t + 0.01))
    values = [{"data": 12.34, "other": 5.67}] * len(times_s)
    found = {
        "messages": {},
        "sent": sent(times_s, values=values),
        "endpoints": (LISTENER, stimulus()),
        "log": log,
    }
    return recording(**{**found, **changes})


def turned(x: float = 1.0, z: float = 0.5, roll: float = 0.0) -> Recording:
    return recording(messages=messages(every(0.3), twist((x, 0, 0), (roll, 0, z))))


def paced(intervals_s: list[float], **changes: Any) -> Recording:
    """A publisher whose messages come after these intervals."""
    times_s = builder.after(intervals_s)
    return recording(messages=messages(times_s), stop_s=max(times_s) + 0.5, **changes)


def crashing(raised: str, **changes: Any) -> Recording:
    """A run in which no node appeared, for its program raised an exception."""
    return nodeless(**{**CRASH, "log": output(traceback(raised)), **changes})


CRASH = {"processes": (died(1),), **EXITED, "log": output(traceback("KeyError: 'x'"))}
SURVIVED = output(traceback("ValueError: no"), time_s=1.5)
BAD_PARAMETERS = (
    "rclpy._rclpy_pybind11.RCLError: failed to initialize rcl: Couldn't parse params file: "
    "'--params-file /install/share/bot/config/bot.yaml'. Error: Cannot have a value before "
    "ros__parameters at line 3, at /project/src/parse.c:806, at /project/src/rcl/arguments.c:415"
)
COUNT = {"topic": "/cmd_vel", "at_least": 5}
EXPECTED = {"topic": "/cmd_vel", "value": {"linear": {"x": 1.0}, "angular": {"z": 0.5}}}
LOGS = {"topic": "/chatter", "fields": ["data"], "at_least": 4}
NAMED = {"name": NODE}
ENABLE = {"service": "/enable", "within": "1 s"}
EACH = {"topic": "/cmd_vel", "period": "300 ms"}
PACKAGE = {"package": "bot_publisher"}
EXECUTABLE = {"package": "bot_publisher", "executable": "bot_pub"}
OF_INTERFACE = {"interface": INTERFACE}


# A check, its parameters, and what it judges by the explanations that answer.
CASES: list[Group] = [
    (
        "node.exists",
        NAMED,
        {
            "NoNode.process_ended ProcessExit.main_returned": nodeless(
                processes=(died(0),), **EXITED
            ),
            "ProcessExit.limit_exceeded": nodeless(
                processes=(died(-9),), breaches=(Breach(1, "memory", "much", "little"),), **EXITED
            ),
            "ProcessExit.ended_by_signal": nodeless(processes=(died(-11),), **EXITED),
            "ProcessExit.raised Raised.any_exception": nodeless(**CRASH),
            "ProcessExit.machine_lacks_it": crashing(
                "ModuleNotFoundError: No module named 'tf_transformations'"
            ),
            "ProcessExit.parameter_file_unreadable": crashing(BAD_PARAMETERS),
            "Raised.not_imported": crashing("NameError: name 'Twist' is not defined"),
            "ProcessExit.hides_what_node_has": crashing(
                "TypeError: 'method' object does not support the context manager protocol",
                submission=submission(
                    package(
                        sources=(
                            SourceFile(
                                "src/bot_publisher/bot_publisher/node.py",
                                "bot_publisher.node",
                                classes=(SourceClass("Bot", 8, ("Node",)),),
                                functions=(SourceFunction("Bot.handle", 20),),
                            ),
                        )
                    )
                ),
            ),
            "Raised.no_such_field": crashing(
                "AttributeError: 'Vector3' object has no attribute 'w'",
                declarations=(declared("started"), declared("exiting", 2.0, fields="x y")),
            ),
            "Raised.imported_from_elsewhere": crashing(
                "ImportError: cannot import name 'Twist' from 'std_msgs.msg' (/opt/ros/jazzy)"
            ),
            "Raised.own_module": crashing("ModuleNotFoundError: No module named 'node'"),
            "Raised.file_not_installed": crashing(
                "FileNotFoundError: [Errno 2] No such file or directory: 'config/speed.txt'",
                submission=submission(files=("src/bot_publisher/config/speed.txt",)),
            ),
            "NoNode.not_built": nodeless(**NOT_STARTED, submission=submission(build=FAILED_BUILD)),
            "NoNode.no_executable": nodeless(**NOT_STARTED),
            "NoNode.never_appeared": nodeless(
                declarations=(declared("started"), declared("node", node=NODE))
            ),
            "NoNode.main_does_not_come_to_it": nodeless(),
            "OtherNode.process_ended": recording(
                nodes=(node("/logger"),), **{**CRASH, "processes": (process("b/o"), died(1))}
            ),
            "OtherNode.node_never_appeared": recording(
                nodes=(node("/other"),),
                declarations=(*declarations(), declared("node", node="/other")),
            ),
            "OtherNode.other_name": recording(nodes=(node("/minimal"),), declarations=()),
        },
    ),
    (
        "node.alive",
        {},
        {
            "ProcessExit.service_without_response": recording(
                **{
                    **CRASH,
                    "log": output(traceback("TypeError").replace(", in f", ", in send_response")),
                }
            ),
        },
    ),
    (
        "topic.published",
        {"topic": "/cmd_vel"},
        {
            "NoEndpoint.no_node": nodeless(),
            "NoEndpoint.misspelt_name": silent(endpoints=(endpoint("/cmdvel"), reader())),
            "NoEndpoint.process_ended": silent(endpoints=(reader(),), **CRASH),
            "NoEndpoint.never_appeared": silent(endpoints=(reader(),)),
        },
    ),
    (
        "service.exists",
        {"service": "/enable", "type": "std_srvs/srv/SetBool"},
        {
            "NoEndpoint.other_interface": serving(services=(service(type="std_srvs/srv/Trigger"),)),
        },
    ),
    (
        "service.exists",
        {"service": "/enable"},
        {
            "NoEndpoint.others_only": serving(services=()),
        },
    ),
    (
        "messages.count",
        COUNT,
        {
            "NoMessages.no_endpoint": silent(endpoints=(reader(),)),
            "NoMessages.other_type": silent(
                endpoints=(endpoint(type="geometry_msgs/msg/Twists"), reader())
            ),
            "NoMessages.unreadable": silent(unreadable={"/cmd_vel": 3}),
            "NoMessages.incompatible_qos": silent(endpoints=(endpoint(), reader(qos=LATCHED))),
            "NoMessages.never_matched": silent(
                disturbance=taken(0.1, 1.0, waited_s=0.6),
                declarations=(*declarations(), declared("held", topic="/cmd_vel", matched=False)),
            ),
            "NoMessages.process_ended": silent(processes=(died(1),)),
            "NoMessages.publisher_destroyed": silent(endpoints=(gone(endpoint()), reader())),
            "NoMessages.nothing_to_answer NotDelivered.no_endpoint": answering(),
            "NoMessages.deaf_by_qos": silent(
                declarations=declarations(timer_s=None),
                endpoints=(endpoint(), reader(), *deaf("/scan", "sensor_msgs/msg/LaserScan")),
            ),
            "NoMessages.slow_timer": silent(declarations=declarations(timer_s=300.0)),
            "NoMessages.no_cpu_time": silent(calls=(), disturbance=BUSY),
            "NoMessages.callback_raised": silent(log=SURVIVED),
            "NoMessages.never_spun": silent(declarations=declarations(spin=False)),
            "NoMessages.blocked_executor": silent(calls=HANGS),
            "NoMessages.no_answer": answering(LISTENER, times_s=every(0.3, 5)),
            "NoMessages.hears_nothing": silent(
                endpoints=(endpoint(), reader(), LISTENER, replace(stimulus(), topic="/chat"))
            ),
            "NoMessages.no_timer": silent(declarations=declarations(timer_s=None)),
            "NoMessages.publish_not_reached": silent(),
            "NotDelivered.other_type": answering(replace(LISTENER, type="std_msgs/msg/Int64")),
            "NotDelivered.incompatible_qos": answering(replace(LISTENER, qos=LATCHED)),
            "NotDelivered.nothing_sent": answering(LISTENER),
            "FewMessages.unreadable": recording(
                messages=messages([1.0]), unreadable={"/cmd_vel": 3}
            ),
            "FewMessages.process_ended": recording(messages=messages([1.0]), processes=(died(1),)),
            "FewMessages.no_cpu_time": recording(messages=messages([1.0]), disturbance=BUSY),
            "FewMessages.publisher_destroyed": recording(
                messages=messages([0.7]), endpoints=(gone(endpoint()), reader())
            ),
            "FewMessages.callback_raised": recording(messages=messages([1.0]), log=SURVIVED),
            "FewMessages.never_spun": recording(
                messages=messages([1.0]), declarations=declarations(spin=False)
            ),
            "FewMessages.publishing_stopped": recording(messages=messages([1.0])),
        },
    ),
    (
        "service.responds",
        ENABLE,
        {
            "NoAnswer.process_ended": serving(asked(1.0, None), processes=(died(1),)),
            "NoAnswer.no_cpu_time": serving(asked(1.0, None), disturbance=BUSY),
            "NoAnswer.callback_raised": serving(asked(1.0, None), log=SURVIVED),
            "NoAnswer.never_spun": serving(asked(1.0, None), declarations=declarations(spin=False)),
            "NoAnswer.blocked_executor": serving(asked(1.0, None), *HANGS),
            "NoAnswer.callback_does_not_answer": serving(asked(1.0, None)),
        },
    ),
    (
        "client.asks",
        {"server": "/enable", "sequence": [{}, {}]},
        {
            "NotAsked.no_client NoEndpoint.misspelt_name": asking(clients=(service("/enabel"),)),
            "NotAsked.process_ended ProcessExit.raised": asking(to_service(), **CRASH),
            "NotAsked.callback_raised": asking(to_service(), log=SURVIVED),
            "NotAsked.waits_in_a_callback": asking(to_service(0.7), calls=HANGS),
            "NotAsked.stops_after_a_failure": asking(to_service(1.0, None, status="unanswered")),
            "NotAsked.too_few": asking(to_service()),
        },
    ),
    (
        "messages.equal",
        EXPECTED,
        {
            "WrongValue.integer_in_a_float_field": turned(5e-324),
            "WrongValue.not_a_number": turned(math.inf),
            "WrongValue.fields_swapped": turned(0.5, 1.0),
            "WrongValue.every_number_zero": turned(0.0, 0.0),
            "WrongValue.in_another_field": turned(1.0, 0.0, 0.5),
            "WrongValue.wrong_sign_or_unit": turned(-1.0),
        },
    ),
    (
        "timing.period",
        EACH,
        {
            "WrongRhythm.several_in_each_period": paced([0.15] * 20),
            "WrongRhythm.irregular": paced([0.3, 0.21, 0.39, 0.3, 0.25, 0.42, 0.3, 0.2, 0.37]),
            "WrongRhythm.other_timer": paced([3.0, 3.0]),
            "WrongRhythm.right_timer_too_late": paced([0.42] * 10),
            "WrongRhythm.sleeping_loop": paced(
                [0.405] * 10, declarations=declarations(timer_s=None)
            ),
            "WrongRhythm.other_period": paced([0.2] * 20, declarations=()),
        },
    ),
    (
        "log.follows",
        LOGS,
        {
            "ReceivedNotLogged.not_delivered": logging(endpoints=(stimulus(),)),
            "ReceivedNotLogged.process_ended": logging(processes=(died(1, 3.0),)),
            "ReceivedNotLogged.too_few_sent": logging(sent=sent([1.0], values=[{"data": 1.5}])),
            "ReceivedNotLogged.no_cpu_time": logging(disturbance=BUSY, calls=()),
            "ReceivedNotLogged.subscription_destroyed": logging(
                endpoints=(gone(LISTENER, 3.0), stimulus())
            ),
            "ReceivedNotLogged.callback_raised": logging(log=SURVIVED),
            "ReceivedNotLogged.never_spun": logging(declarations=declarations(spin=False)),
            "ReceivedNotLogged.blocked_executor": logging(calls=HANGS),
            "ReceivedNotLogged.output_dropped": logging(processes=(process(dropped_bytes=9),)),
            "ReceivedNotLogged.slow_callbacks": logging("hm", calls=builder.calls(0.9)),
            "ReceivedNotLogged.only_some_logged": logging(
                log=output("12.34", time_s=1.01) + output("12.34", time_s=1.31)
            ),
            "ReceivedNotLogged.no_f_string": logging("x = {msg.data}"),
            "ReceivedNotLogged.other_values": logging("x = 5.67"),
            "ReceivedNotLogged.nothing_logged": logging(),
        },
    ),
    (
        "log.follows",
        {**LOGS, "sent": "before_launch"},
        {
            "ReceivedNotLogged.no_history": logging(
                sent=sent(every(-0.1, 5, -0.1), values=[{"data": 12.34}] * 5)
            ),
        },
    ),
    (
        "log.follows",
        {**LOGS, "own": True},
        {
            f"PublishedNotLogged.{name}": logging(
                messages=messages(every(0.3, count, 1.0), {"data": 12.34}, topic="/chatter"),
                sent={},
                endpoints=(endpoint("/chatter"),),
            )
            for name, count in {"too_few_published": 1, "own_not_logged": 5}.items()
        },
    ),
    (
        "package.found",
        PACKAGE,
        {
            "NoPackage.no_workspace": submission(problem="it is empty"),
            "NoPackage.broken_package_xml": submission(
                package("pub", manifest_error=SourceError("package.xml", 1, "broken"))
            ),
            "NoPackage.other_package_name": submission(package("bot_pub")),
        },
    ),
    (
        "package.builds",
        PACKAGE,
        {
            "NotBuilt.build_takes_too_long": submission(
                build=replace(FAILED_BUILD, timed_out=True)
            ),
            "NotBuilt.machine_lacks_a_package": submission(
                package(build_type="ament_cmake"),
                build=replace(
                    FAILED_BUILD, lacking=("nav2_msgs",), log=NEEDS_NAV2.format("bot_publisher")
                ),
            ),
            "NotBuilt.build_failed": submission(build=FAILED_BUILD),
            "NotBuilt.depends_on_another": submission(
                package(),
                package("other"),
                build=replace(
                    FAILED_BUILD,
                    log="Starting >>> other\n",
                    failed_packages=("bot_publisher", "other"),
                ),
            ),
        },
    ),
    (
        "interface.found",
        OF_INTERFACE,
        {
            "NoDefinition.near_definition": handed_in(file="msgs/BotStatus.msg"),
            "NoDefinition.no_definition": handed_in(definitions=(), generated=()),
        },
    ),
    (
        "interface.generated",
        OF_INTERFACE,
        {
            "NotGenerated.no_cmake": unbuilt(cmake=None),
            "NotGenerated.generates_nothing": unbuilt(cmake="project(bot_msgs)\nament_package()\n"),
            "NotGenerated.not_listed": unbuilt(cmake=CMAKE.replace("BotStatus", "Wheel")),
            "NotGenerated.undeclared_package": unbuilt(
                cmake=CMAKE.replace("  DEPENDENCIES geometry_msgs\n", "")
            ),
        },
    ),
    (
        "package.executable",
        EXECUTABLE,
        {
            "NoExecutable.no_such_function": submission(
                package(missing_targets=(("bot_pub", SourceError("setup.py", 22, "no module")),))
            ),
            "NoExecutable.installed_elsewhere": submission(
                package(executables=(), misplaced_executables=("bot_pub",))
            ),
            "NoExecutable.not_installed_by_cmake": submission(
                package(executables=(), build_type="ament_cmake")
            ),
            "NoExecutable.no_console_scripts": submission(package(executables=(), entry_points=())),
            "NoExecutable.other_console_scripts": submission(package(executables=())),
        },
    ),
    (
        "parameter.declared",
        {"node": NODE, "name": "speed"},
        {
            "NotDeclared.services_not_asked": recording(),
            "NotDeclared.other_parameters": recording(calls=parameters_read(sped=1.0)),
        },
    ),
    (
        "action.cancels",
        {"action": "/fibonacci"},
        {
            "NotCanceled.cancel_refused": acting(
                canceled(cancel_accepted=False, status="succeeded")
            ),
            "NotCanceled.execute_callback_raised": acting(
                canceled(status="succeeded", end_s=0.9), log=SURVIVED
            ),
            "NotCanceled.executor_busy_with_the_goal": acting(
                canceled(cancel_answered_ns=None, cancel_accepted=None, status="succeeded")
            ),
            "NoAnswer.busy_with_something_else": acting(
                canceled(cancel_answered_ns=None, cancel_accepted=None, status="", end_s=None),
                calls=(),
            ),
            "NotCanceled.request_ignored": acting(canceled(status="succeeded", end_s=0.9)),
        },
    ),
]


ALL = [
    pytest.param(names, check, subject, parameters, id=names)
    for check, parameters, subjects in (*CASES, *motion_cases.CASES)
    for names, subject in subjects.items()
]


@pytest.mark.parametrize(("names", "check", "subject", "parameters"), ALL)
def test_the_explanation_answers_for_its_case(
    names: str, check: str, subject: Any, parameters: dict[str, Any]
) -> None:
    judged = subject() if callable(subject) else subject
    with answers() as found:
        judge(check, judged, **parameters)
    assert set(names.split()) <= found


def test_every_explanation_has_a_case() -> None:
    named = {name for case in ALL for name in str(case.id).split()}
    catalogue = {
        f"{symptom.__name__}.{entry.name}"
        for symptom, entries in explanations().items()
        for entry in entries
        # Those of the table have an example of their own.
        if not entry.example
    }
    assert named - catalogue == set()
    # One that came later has a test of its own beside this one.
    texts = [file.read_text() for file in Path(__file__).parent.glob("test_*.py")]
    for name in catalogue - named:
        assert any(name.partition(".")[2] in text for text in texts), f"{name} has no case"


def test_a_parameter_file_that_ros_cannot_read_is_named_with_its_line() -> None:
    handed_in = submission(package(), files=("src/bot/config/bot.yaml", "src/bot/bot.yaml"))
    run = crashing(BAD_PARAMETERS, submission=handed_in)
    finding = judge("node.exists", run, **NAMED)
    assert "cannot read the parameter file `src/bot/config/bot.yaml`" in finding.observed
    assert "with two underscores" in finding.hint
    assert [(place.file, place.line) for place in finding.evidence.places] == [
        ("src/bot/config/bot.yaml", 3)
    ]
