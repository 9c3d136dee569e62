"""node.exists, node.alive and node.ends: what a student reads when the node is not there."""

from dataclasses import replace

import pytest

from grader.findings.finding import Status
from grader.recording.event import Breach, Intervention, Wait
from grader.recording.model import Ending, Kind, Owner
from grader.recording.submission import BuildRecord, SourceError, SourceFile, SourceFunction
from tests.checks.builder import (
    BOT,
    INSTALLED,
    NODE,
    SOURCE,
    at,
    call,
    declarations,
    declared,
    died,
    endpoint,
    every,
    failing,
    judge,
    messages,
    node,
    nodeless,
    output,
    package,
    process,
    reader,
    recording,
    submission,
    taken,
    text,
    traceback,
)
from tests.checks.requests import service


def crashed(printed="", exit_code=1, **changes):
    """A program that ended before it had a node."""
    ended = {"processes": (died(exit_code),), "ending": Ending.EXITED, "log": output(printed)}
    return nodeless(**{**ended, **changes})


class TestExists:
    @pytest.mark.parametrize("name", ["bot_publisher", "/bot_publisher"])
    def test_plain_and_full_names_mean_the_same(self, name):
        assert judge("node.exists", recording(), name=name).status is Status.PASSED

    def test_a_name_that_ros_does_not_allow_is_the_authors_mistake(self):
        with pytest.raises(ValueError, match="bot publisher' is not a node name"):
            judge("node.exists", recording(), name="bot publisher")

    def test_another_node_that_publishes_in_its_place(self):
        helper = "/pub"
        run = recording(nodes=(node(), node(helper)), endpoints=(endpoint(node=helper), reader()))
        assert judge("node.exists", run, name=NODE).status is Status.PASSED
        found = failing("node.exists", run, name=NODE, publishes="/cmd_vel")
        assert "`/bot_publisher` is there, but `/pub` publishes on `/cmd_vel`" in found

    @pytest.mark.parametrize("topic", ["/cmd_vel", "/elsewhere"])
    def test_it_publishes_itself_or_nothing_does(self, topic):
        run = recording(endpoints=(endpoint(topic), reader()))
        assert judge("node.exists", run, name=NODE, publishes="/cmd_vel").status is Status.PASSED

    @pytest.mark.parametrize(
        ("why", "hint"),
        [
            ("Permission denied", "install(PROGRAMS ...)"),
            ("Exec format error", "begins with the line `#!/usr/bin/env python3`"),
            ("No such file or directory", "the line ends of Linux"),
        ],
    )
    def test_what_could_not_be_started_is_named(self, why, hint):
        wait = Wait(f"start of bot_publisher/bot_pub: {why}", 0.0, at(0))
        run = nodeless(ending=Ending.NOT_STARTED, processes=(), waits=(wait,))
        found = failing("node.exists", run, name=NODE)
        assert f"`bot_publisher/bot_pub` could not be started: {why}" in found
        assert hint in found

    def test_nothing_launched_because_the_build_failed(self):
        culprit = SourceError("src/bot_publisher/setup.py", 7, "SyntaxError: invalid syntax")
        build = BuildRecord(False, 1.0, failed_packages=("bot_publisher",), culprit=culprit)
        run = nodeless(ending=Ending.NOT_STARTED, processes=(), submission=submission(build=build))
        finding = judge("node.exists", run, name=NODE)
        assert "did not build" in finding.observed
        assert finding.evidence.places == (culprit,)

    def test_an_exception_is_named_with_the_students_own_line(self):
        run = crashed(traceback("ValueError: math domain error"))
        finding = judge("node.exists", run, name=NODE)
        assert "ended 1.20 s after launch with ValueError: math domain error" in finding.observed
        assert f"{SOURCE}:14" in finding.observed
        assert finding.evidence.places == (
            SourceError(SOURCE, 14, "ValueError: math domain error"),
        )
        assert finding.evidence.log[-1] == "ValueError: math domain error"

    def test_a_syntax_error_points_at_the_line_that_python_cannot_read(self):
        log = output(
            "Traceback (most recent call last):\n"
            '  File "/w/install/lib/bot_publisher/bot_pub", line 25, in importlib_load\n'
            "    return next(matches).load()\n"
            '  File "/w/install/lib/python3.12/site-packages/bot_publisher/node.py", line 9\n'
            "    def main(:\n"
            "             ^\n"
            "SyntaxError: invalid syntax"
        )
        run = nodeless(processes=(died(1),), ending=Ending.EXITED, log=log)
        found = failing("node.exists", run, name=NODE)
        assert f"SyntaxError: invalid syntax ({SOURCE}:9)" in found

    @pytest.mark.parametrize(
        ("name", "hint"),
        [
            ("Twist", "import it at the top of the file: `from geometry_msgs.msg import Twist`"),
            ("rclpy", "`import rclpy`. Otherwise it is misspelt"),
        ],
    )
    def test_an_undefined_name_of_ros_comes_with_its_import(self, name, hint):
        run = crashed(traceback(f"NameError: name '{name}' is not defined"))
        assert hint in judge("node.exists", run, name=NODE).hint

    def test_another_process_s_node_in_the_same_namespace_is_no_misspelling(self):
        run = recording(
            nodes=(node("/robot1/speed_limiter"),),
            processes=(process(), died(1, name="bot/driver")),
            log=output(traceback("ValueError: no speed"), name="bot/driver"),
        )
        found = failing("node.exists", run, name="/robot1/driver")
        assert "the process `bot/driver` ended 1.20 s after launch with ValueError" in found
        misspelt = replace(run, nodes=(node("/robot1/drivr"),))
        assert "found the node" in failing("node.exists", misspelt, name="/robot1/driver")

    def test_a_callback_of_a_service_that_returns_nothing_is_not_blamed_on_spin(self):
        printed = (
            "Traceback (most recent call last):\n"
            f'  File "{INSTALLED}", line 14, in main\n'
            "    rclpy.spin(node)\n"
            '  File "/opt/ros/jazzy/lib/python3.12/site-packages/rclpy/service.py", line 75, in '
            "send_response\n"
            "    raise TypeError()\n"
            "TypeError"
        )
        run = crashed(printed)
        finding = judge("node.exists", run, name=NODE)
        assert "with TypeError: a service's callback did not return a response" in finding.observed
        assert "`return response`" in finding.hint
        assert finding.evidence.places == ()
        told = (declared("ran", 1.0, callback="Bot.enable", serves="/enable"),)
        enable = SourceFile(SOURCE, "node", functions=(SourceFunction("Bot.enable", 31),))
        named = replace(
            run,
            services=(service(),),
            declarations=told,
            submission=submission(package(sources=(enable,))),
        )
        finding = judge("node.exists", named, name=NODE)
        assert finding.observed.endswith(f"did not return a response ({SOURCE}:31)")
        assert [place.line for place in finding.evidence.places] == [31]

    @pytest.mark.parametrize(
        ("exit_code", "words"),
        [
            (-11, "SIGSEGV (segmentation fault)"),
            (139, "SIGSEGV (segmentation fault), reported as exit code 139"),
            (-9, "SIGKILL (killed: by itself, or for too much memory)"),
            (-6, "SIGABRT (abort)"),
            (3, "exit code 3"),
        ],
    )
    def test_a_crash_is_named_by_its_signal(self, exit_code, words):
        run = crashed(exit_code=exit_code)
        assert words in failing("node.exists", run, name=NODE)

    def test_a_process_that_hangs_before_init_names_the_line_it_hangs_at(self):
        interrupted = traceback("KeyboardInterrupt", source="time.sleep(60)", line=5)
        run = nodeless(processes=(process(),), log=output(interrupted, time_s=5.0))
        found = failing("node.exists", run, name=NODE)
        assert "never called rclpy.init()" in found and "in line 5, `time.sleep(60)`" in found
        assert "sleep" in found

    def test_a_process_that_waits_for_input(self):
        log = output(traceback("KeyboardInterrupt", source="name = input('Name? ')", line=6))
        found = failing("node.exists", nodeless(log=log), name=NODE)
        assert "in line 6, `name = input('Name? ')`" in found and "no keyboard" in found

    def test_a_process_that_called_init_but_made_no_node(self):
        run = nodeless(declarations=(declared("started"), declared("init")))
        assert "called rclpy.init() but created no node" in failing("node.exists", run, name=NODE)

    def test_without_a_tracer_init_is_not_mentioned(self):
        found = failing("node.exists", nodeless(declarations=()), name=NODE)
        assert "ran until the end, but created no node" in found
        assert "never called" not in found

    def test_a_node_that_is_declared_but_never_seen_is_excused_by_a_busy_machine_only(self):
        run = nodeless(declarations=(declared("started"), declared("node", node=NODE)))
        assert "never appeared in the ROS graph" in failing("node.exists", run, name=NODE)
        assert judge("node.exists", run, name=NODE).disturbed
        busy = replace(run, disturbance=taken(0.1, 1.0, waited_s=0.6))
        finding = judge("node.exists", busy, name=NODE)
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)

    def test_a_node_that_left_the_environment_of_the_run_loses_the_points_at_any_load(self):
        said = (declared("started"), declared("init", changed="ROS_DISCOVERY_SERVER"))
        run = nodeless(declarations=(*said, declared("node", node=NODE)))
        busy = replace(run, disturbance=taken(0.1, 1.0, waited_s=2.0))
        found = failing("node.exists", busy, name=NODE)
        assert "changed ROS_DISCOVERY_SERVER, which nodes use to find each other" in found

    @pytest.mark.parametrize(
        ("actual", "words"),
        [
            ("/Bot_Publisher", "upper and lower case differ"),
            ("/robot/bot_publisher", "in the namespace `/robot`"),
            ("/bot_publishr", "found the node `/bot_publishr`"),
            ("/minimal", "super().__init__('bot_publisher')"),
        ],
    )
    def test_near_misses_of_the_name(self, actual, words):
        run = recording(nodes=(node(actual),), declarations=())
        assert words in failing("node.exists", run, name=NODE)

    def test_a_dead_process_explains_more_than_an_unrelated_node(self):
        other = process("bot_publisher/other")
        run = recording(
            nodes=(node("/logger"),),
            processes=(other, died(1)),
            log=output(traceback("KeyError: 'x'")),
        )
        assert "KeyError: 'x'" in failing("node.exists", run, name=NODE)


class TestStarts:
    def test_any_node_will_do(self):
        run = recording(nodes=(node("/another"),))
        finding = judge("node.starts", run)
        assert finding.status is Status.PASSED
        assert "`/another` appeared 0.30 s after launch" in finding.observed

    def test_a_node_of_the_probe_will_not(self):
        run = nodeless(nodes=(node("/probe", owner=Owner.PROBE),), processes=(died(-11),))
        assert "SIGSEGV" in failing("node.starts", run)

    def test_the_reason_is_the_one_that_node_exists_gives(self):
        run = crashed(traceback("ImportError: cannot import name 'Twists'"))
        assert failing("node.starts", run) == failing("node.exists", run, name=NODE)


_IN_RCLPY = (
    '  File "/opt/ros/jazzy/lib/python3.12/site-packages/rclpy/node.py", line 205, in f\n'
    "    raise it\n"
)


class TestAlive:
    def test_what_is_never_allowed_costs_the_check_even_where_the_node_ran_to_its_end(self):
        violation = "sent SIGKILL to the process that holds their sandbox"
        run = recording(breaches=(Breach(at(1.0), "forbidden call", violation, ""),))
        found = failing("node.alive", run)
        assert found.startswith(
            "its processes sent SIGKILL to the process that holds their sandbox, which is never "
            "allowed"
        )
        assert judge("node.alive", replace(run, breaches=())).status is Status.PASSED

    def test_a_limit_that_did_not_end_anything_costs_nothing(self):
        full = Breach(at(1.0), "disk", "all space in /tmp and home", "64 MiB")
        assert judge("node.alive", recording(breaches=(full,))).status is Status.PASSED

    @pytest.mark.parametrize(
        ("what", "taken", "allowed"),
        [
            ("cpu time", "more than 2 s of CPU time", "2 s"),
            ("forbidden packets", "sent garbage to the UDP ports of the probe", ""),
        ],
    )
    def test_who_was_ended_for_it_reads_why(self, what, taken, allowed):
        breach = Breach(at(1.0), what, taken, allowed)
        run = nodeless(processes=(died(-9),), ending=Ending.EXITED, breaches=(breach,))
        finding = judge("node.alive", run)
        assert finding.status is Status.FAILED
        assert str(breach) in finding.observed and finding.hint

    def test_a_node_that_runs_until_sigint_passes_with_any_exit_code(self):
        for exit_code in (0, 1, -2, 130):
            run = recording(processes=(process(exit_code=exit_code),))
            assert judge("node.alive", run, name=NODE).status is Status.PASSED

    def test_an_exception_in_a_callback(self):
        run = recording(
            processes=(died(1, 2.0),),
            ending=Ending.EXITED,
            stop_s=2.01,
            log=output(traceback("ZeroDivisionError: division by zero", line=20)),
        )
        found = failing("node.alive", run)
        assert f"2.00 s after launch with ZeroDivisionError: division by zero ({SOURCE}:20" in found

    @pytest.mark.parametrize(
        ("raised", "source"),
        [
            ("TypeError: float() argument must be a string or a real number, not 'list'", "x"),
            ("TypeError: 'NoneType' object is not callable", "x"),
            ("AttributeError: 'float' object has no attribute 'x'", "x"),
            ("TypeError: 'property' object is not iterable", "x"),
            ("TypeError: Bot.tick() takes 1 positional argument but 2 were given", "x"),
            ("AttributeError: property 'speed' of 'Bot' object has no setter", "self.speed = 1.0"),
            ("TypeError: Bot.go() missing 1 required positional argument: 'v'", "self.go()"),
            ("AssertionError", "assert self.ready"),
            (
                "TypeError: 'NoneType' object does not support the context manager protocol",
                "with self.lock():",
            ),
        ],
    )
    def test_what_only_looks_like_a_mistake_with_rclpy(self, raised, source):
        log = output(traceback(raised, source=source).replace(_IN_RCLPY, ""))
        run = recording(processes=(died(1),), ending=Ending.EXITED, log=log)
        assert "Correct the line that is named here." in failing("node.alive", run)

    def test_the_first_of_chained_exceptions_is_the_cause(self):
        log = output(
            traceback("ZeroDivisionError: division by zero", line=20)
            + "\n\nDuring handling of the above exception, another exception occurred:\n\n"
            + traceback("RuntimeError: Context must be initialized", line=40)
        )
        run = recording(processes=(died(1),), ending=Ending.EXITED, log=log)
        found = failing("node.alive", run)
        assert "ZeroDivisionError" in found
        assert "RuntimeError" not in found

    def test_a_main_without_spin(self):
        run = recording(
            processes=(died(0),), ending=Ending.EXITED, declarations=declarations(spin=False)
        )
        found = failing("node.alive", run)
        assert "main() returned without rclpy.spin()" in found
        assert "rclpy.spin(node) keeps a node alive" in found

    def test_a_main_that_returned_although_it_spun(self):
        run = recording(processes=(died(0),), ending=Ending.EXITED)
        found = failing("node.alive", run)
        assert "spin_once() handles one round only" in found
        assert "a daemon thread ends with main()" in found

    def test_a_process_that_was_leaving_when_sigint_came_ended_by_itself(self):
        """Under load the way out takes a while; with exit code -2 it shows no more than SIGINT."""
        said = (*declarations()[:-1], declared("exiting", 3.0))
        for exit_code in (0, -2, 1):
            late = process(exited_s=4.7, exit_code=exit_code)
            run = recording(processes=(late,), declarations=said)
            found = failing("node.alive", run)
            assert "ended 3.00 s after launch" in found
            assert "main() returned" in found

    def test_a_node_that_was_destroyed_while_its_process_went_on(self):
        run = recording(nodes=(node(vanished_s=1.5),), messages=messages(every(0.3, 2)), calls=())
        assert "left the ROS graph 1.50 s after launch" in failing("node.alive", run, name=NODE)

    def test_what_others_publish_is_no_sign_of_life(self):
        run = recording(
            nodes=(node(vanished_s=1.5),),
            endpoints=(endpoint(), endpoint("/odom", kind=Kind.SUBSCRIPTION), reader()),
            messages={**messages(every(0.3, 2)), **messages(every(0.1, 30), topic="/odom")},
            calls=(),
        )
        assert "left the ROS graph 1.50 s after launch" in failing("node.alive", run)

    def test_a_helper_node_that_was_destroyed_is_not_the_node(self):
        helper = node("/settings", appeared_s=0.2, vanished_s=0.9)
        run = recording(nodes=(helper, node()))
        assert judge("node.alive", run).status is Status.PASSED
        mute = recording(nodes=(helper, node()), endpoints=(reader(),), messages={})
        assert judge("node.alive", mute).status is Status.PASSED
        heard = endpoint(kind=Kind.SUBSCRIPTION, node="/settings")
        listens = recording(nodes=(helper, node()), endpoints=(endpoint(), heard, reader()))
        assert judge("node.alive", listens).status is Status.PASSED

    def test_a_publisher_that_was_destroyed_while_a_helper_node_lives(self):
        run = recording(
            nodes=(node(vanished_s=1.5), node("/settings")),
            messages=messages(every(0.3, 2)),
            calls=(),
        )
        assert "`/bot_publisher` left the ROS graph 1.50 s" in failing("node.alive", run)

    def test_a_graph_that_lost_a_working_node_for_a_moment_proves_nothing(self):
        lost = (node(vanished_s=1.5),)
        assert judge("node.alive", recording(nodes=lost)).status is Status.PASSED
        quiet = recording(nodes=lost, messages={}, calls=(call(2.0),))
        assert judge("node.alive", quiet).status is Status.PASSED
        again = recording(nodes=(*lost, node(appeared_s=1.7)), messages={}, calls=())
        assert judge("node.alive", again).status is Status.PASSED

    def test_a_node_that_never_appeared(self):
        found = failing("node.alive", recording(), name="/bot_pub")
        assert "found the node `/bot_publisher`" in found

    def test_the_death_of_another_process_does_not_count_for_a_named_node(self):
        healthy = process("bot_publisher/bot_pub")
        other = died(1, name="bot_publisher/other")
        run = recording(processes=(healthy, other))
        assert judge("node.alive", run, name=NODE).status is Status.PASSED
        assert "`bot_publisher/other` ended" in failing("node.alive", run)

    def test_an_end_after_the_observation_is_no_early_end(self):
        run = recording(processes=(replace(died(0), exited_ns=at(4.55)),))
        assert judge("node.alive", run).status is Status.PASSED


class TestFinishes:
    def test_a_program_that_ends_by_itself_passes(self):
        run = recording(processes=(died(0),), ending=Ending.EXITED)
        assert judge("node.finishes", run).status is Status.PASSED

    def test_one_that_runs_on_is_reported(self):
        found = failing("node.finishes", recording())
        assert "ran until SIGINT" in found
        assert "Let spin return" in found

    def test_one_that_runs_on_because_the_machine_was_busy_must_do_so_again(self):
        run = recording(disturbance=taken(1.0, 4.0, waited_s=2.0))
        assert judge("node.finishes", run).disturbed

    def test_an_exception_is_no_end_of_its_work(self):
        run = recording(processes=(died(1),), log=output(traceback("KeyError: 'x'")))
        assert "KeyError" in failing("node.finishes", run)


class TestEnds:
    def test_the_exit_status_does_not_matter(self):
        log = output(traceback("KeyboardInterrupt", source="rclpy.spin(node)"), time_s=4.55)
        run = recording(processes=(process(exit_code=1),), log=log)
        assert judge("node.ends", run, within="2 s").status is Status.PASSED

    def test_ending_too_late_is_reported(self):
        run = recording(processes=(process(exited_s=7.7, stop_s=3.2),), end_s=7.7)
        found = failing("node.ends", run, within="2 s")
        assert "needed 3.2 s to end after SIGINT" in found

    @pytest.mark.parametrize("signal", ["SIGTERM", "SIGKILL"])
    def test_more_than_sigint_was_needed(self, signal):
        stubborn = process(stopped_by=signal, stop_s=2.3, exited_s=6.8)
        run = recording(processes=(stubborn,), end_s=6.8)
        found = failing("node.ends", run, within="2 s")
        assert f"did not end after SIGINT; {signal} was needed" in found
        assert "bare `except:`" in found

    def test_a_busy_machine_is_not_the_students_fault(self):
        slow = process(exited_s=7.7, stop_s=1.7)
        run = recording(processes=(slow,), end_s=7.7, disturbance=taken(4.5, 7.0, waited_s=1.5))
        assert judge("node.ends", run, within="2 s").status is Status.PASSED

    @pytest.mark.parametrize("waited_s", [0.5, 1.5, 2.5])
    def test_what_the_machine_took_is_taken_off_once(self, waited_s):
        stubborn = process(stopped_by="SIGTERM", stop_s=2.3, exited_s=6.8 + waited_s)
        took = taken(4.5, 6.0, waited_s=waited_s)
        run = recording(processes=(stubborn,), end_s=7.0 + waited_s, disturbance=took)
        assert "SIGTERM was needed" in failing("node.ends", run, within="2 s")
        slow = process(exited_s=7.7 + waited_s, stop_s=3.2)
        run = recording(processes=(slow,), end_s=8.0 + waited_s, disturbance=took)
        assert "needed 3.2 s" in failing("node.ends", run, within="2 s")

    def test_a_machine_that_took_nearly_everything_leaves_it_open(self):
        starved = process(stopped_by="SIGTERM", stop_s=2.3, exited_s=22.8)
        took = taken(4.5, 22.0, waited_s=17.0)
        run = recording(processes=(starved,), end_s=23.0, disturbance=took)
        finding = judge("node.ends", run, within="2 s")
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)

    @pytest.mark.parametrize(
        ("planner_s", "driver_s", "told"),
        [
            (4.6, 4.9, None),
            (4.9, 4.6, "`/planner` ended 300 ms after `/driver`"),
            (4.6, 4.6, "`/planner` and `/driver` ended at the same moment"),
        ],
    )
    def test_one_node_ends_before_another(self, planner_s, driver_s, told):
        ends = {"planner": planner_s, "driver": driver_s}
        run = recording(
            nodes=tuple(node(f"/{name}") for name in ends),
            processes=tuple(process(f"bot/{name}", exited_s=end) for name, end in ends.items()),
            declarations=tuple(
                declared("node", name=f"bot/{name}", node=f"/{name}") for name in ends
            ),
        )
        order = {"within": "2 s", "node": "/planner", "before": "/driver"}
        if told is None:
            assert judge("node.ends", run, **order).status is Status.PASSED
        else:
            assert told in failing("node.ends", run, **order)

    def test_processes_that_survive_are_named(self):
        run = recording(processes=(process(survivors=("sleep 100", "python3 x.py")),))
        found = failing("node.ends", run, within="2 s")
        assert "left 2 processes running behind it: `sleep 100` and `python3 x.py`" in found

    def test_a_process_that_had_ended_before_says_why(self):
        run = recording(
            processes=(died(1),), ending=Ending.EXITED, log=output(traceback("KeyError: 'x'"))
        )
        found = failing("node.ends", run, within="2 s")
        assert "had already ended before SIGINT" in found
        assert "KeyError: 'x'" in found

    def test_a_process_that_not_even_sigkill_ended_is_our_problem(self):
        stuck = process(exited_s=None, stopped_by="SIGKILL", stop_s=None, exit_code=None)
        finding = judge("node.ends", recording(processes=(stuck,)), within="2 s")
        assert finding.status is Status.ERROR
        assert f"`{BOT}` could not be ended" in finding.observed

    def test_without_a_launch_that_is_the_cause(self):
        run = nodeless(ending=Ending.NOT_STARTED, processes=())
        assert "nothing was launched" in failing("node.ends", run, within="2 s")

    def test_a_limit_without_unit_is_refused(self):
        with pytest.raises(ValueError, match="has no unit"):
            judge("node.ends", recording(), within=2)


def test_endpoints_of_others_are_not_the_students():
    run = recording(nodes=(node("/probe"),), endpoints=(endpoint(node="/probe"),))
    assert "found the node `/probe`" in text(judge("node.exists", run, name=NODE))


class TestKilledByTheScenario:
    """What a stimulus ends did not end early."""

    def run(self, **changes):
        killed = process(exited_s=2.1, stopped_by="SIGKILL", exit_code=-9, stop_s=0.1)
        again = process(started_ns=at(2.5))
        interventions = (
            Intervention(at(2.0), BOT, "kill", "SIGKILL"),
            Intervention(at(2.5), BOT, "restart"),
        )
        nodes = (node(vanished_s=2.2), node(appeared_s=2.9))
        defaults = {
            "processes": (killed, again), "interventions": interventions, "nodes": nodes
        }  # fmt: skip
        return recording(**{**defaults, **changes})

    def test_it_counts_as_alive(self):
        assert judge("node.alive", self.run()).status is Status.PASSED

    def test_only_the_end_of_its_second_life_counts(self):
        assert judge("node.ends", self.run(), within="1 s").status is Status.PASSED

    def test_a_restart_that_dies_is_reported(self):
        killed = self.run().processes[0]
        run = self.run(processes=(killed, died(1, exited_s=3.0)))
        assert "exit code 1" in failing("node.alive", run)

    def test_without_a_second_life_there_is_nothing_to_judge(self):
        run = self.run(processes=self.run().processes[:1])
        assert judge("node.ends", run, within="1 s").status is Status.ERROR
