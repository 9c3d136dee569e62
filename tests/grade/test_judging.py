"""What a grade promises to a student, and what it promises to the author of an assignment."""

from dataclasses import replace

import pytest

from grader.assignment.model import Launch, Scenario
from grader.checks.check import Subject
from grader.checks.motion.robot_check import RobotParameters
from grader.findings.finding import Evidence, Finding, Moment, Status, Verdict
from grader.grade import judge_all
from grader.recording.event import Disturbance
from grader.recording.model import NS, Call, Ending, Node, Owner
from grader.recording.simulated import Truth
from grader.recording.submission import BuildRecord, Import, PackageRecord, SourceError
from grader.report.model.facts import RunFacts
from grader.report.model.result import make_result
from grader.spec.names import Names, Thing, WrongName
from tests.grade.sample import (
    FAIL,
    LAUNCHED_NS,
    PASS,
    Told,
    make_loaded,
    make_recording,
    make_submission,
)


def judge(*checks, scenarios=("listen",), submission=None, recordings=None):
    submission = submission or make_submission()
    if recordings is None:
        recordings = {name: make_recording(name) for name in scenarios}
    return judge_all(make_loaded(checks, scenarios), submission, recordings)


def drive(seconds):
    """A robot at rest, with a step of truth every second."""
    return tuple(
        Truth(LAUNCHED_NS + k * NS, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, None) for k in range(seconds)
    )


def statuses(result):
    return {item.id: item.status.value for item in result.results}


class TestRequirements:
    def test_a_check_whose_requirement_failed_is_skipped_and_not_a_second_mistake(self):
        topic = Told("topic", requires=("node",), title="It publishes on /cmd_vel")
        result = judge(Told("node", FAIL, title="The node is there"), topic)
        assert statuses(result) == {"node": "failed", "topic": "skipped"}
        assert topic.asked == []
        finding = result.result("topic").decisive.finding
        assert finding.observed == "“The node is there” did not pass, so this could not be judged"
        assert finding.hint == "Fix “The node is there” first: this is not a second mistake."

    def test_results_stay_in_the_authors_order(self):
        result = judge(Told("topic", requires=("node",)), Told("node"), Told("alone"))
        assert list(statuses(result)) == ["topic", "node", "alone"]

    def test_a_check_behind_an_error_is_skipped_and_says_it_is_not_the_student_s_fault(self):
        result = judge(Told("node", Finding.error("", "")), Told("topic", requires=("node",)))
        assert statuses(result) == {"node": "error", "topic": "skipped"}
        assert not result.graded
        finding = result.result("topic").decisive.finding
        assert finding.observed == "“Title of node” could not be judged, so neither could this"
        assert finding.hint == "Nothing to fix on your side: tell your instructor."


def first_to_fix(grade):
    return make_result(grade, {}, RunFacts("2026-06-01T12:00:00+02:00", 1.0)).first_to_fix


class TestFirstToFix:
    def test_it_is_the_failed_check_that_most_others_wait_for(self):
        result = judge(
            Told("dependencies", FAIL),
            Told("node", FAIL),
            Told("topic", requires=("node",)),
            Told("values", requires=("topic",)),
        )
        assert first_to_fix(result) == "node"

    def test_a_crash_that_fails_several_checks_comes_before_what_only_misses_its_topic(self):
        place = SourceError("bot.py", 8, "NameError: name 'coutn' is not defined")
        crashed, again = (
            Finding.failed("", f"ended after {ended_s} s", evidence=Evidence(places=(place,)))
            for ended_s in (0.4, 0.5)
        )
        result = judge(
            Told("dependencies", FAIL),
            Told("alive", crashed),
            Told("ends", requires=("alive",)),
            Told("topic", again),
            Told("type", requires=("topic",)),
            Told("values", requires=("type",)),
        )
        assert first_to_fix(result) == "alive"

    def test_what_is_shown_without_points_need_not_be_mended(self):
        result = judge(Told("node", PASS, points=1), Told("silence", FAIL, points=0))
        assert first_to_fix(result) is None
        assert result.full_points

    def test_a_check_without_points_comes_first_if_others_wait_for_it(self):
        result = judge(Told("starts", FAIL, points=0), Told("node", requires=("starts",)))
        assert first_to_fix(result) == "starts"

    def test_two_mistakes_in_one_file_are_two(self):
        places = (SourceError("setup.py", None, "console_scripts"),)
        lacking = Finding.failed("", "it is not there", evidence=Evidence(places=places))
        result = judge(
            Told("talker", lacking),
            Told("listener", lacking),
            Told("node", FAIL),
            Told("topic", requires=("node",)),
        )
        assert first_to_fix(result) == "node"

    def test_of_equals_in_one_run_it_is_what_went_wrong_first(self):
        late, early = (
            Finding.failed("", f"at {time_s} s", evidence=Evidence(moments=(Moment("", time_s),)))
            for time_s in (22.0, 9.0)
        )
        assert first_to_fix(judge(Told("turns", late), Told("visits", early))) == "visits"

    def test_what_ended_in_another_run_may_have_another_reason(self):
        ended = Evidence(moments=(Moment("bot ended", 0.4),))
        crashed = Finding.failed("", "ended", evidence=ended)
        result = judge(
            Told("alive", {"listen": crashed, "renamed": PASS}),
            Told("topic", {"listen": PASS, "renamed": crashed}),
            Told("values", requires=("topic",)),
            scenarios=("listen", "renamed"),
        )
        assert first_to_fix(result) == "topic"


class TestScenarios:
    def test_a_check_passes_only_where_every_scenario_passes(self):
        says = {"listen": PASS, "renamed": FAIL}
        result = judge(Told("node", says), scenarios=("listen", "renamed"))
        node = result.result("node")
        assert (node.status, node.points) == (Status.FAILED, 0.0)
        assert [(item.scenario, item.finding) for item in node.findings] == list(says.items())
        assert node.decisive.scenario == "renamed"

    def test_partial_credit_is_that_of_the_worst_scenario(self):
        says = {
            "near": Finding.failed("0.1 m", "0.2 m", credit=0.5),
            "far": Finding.failed("0.1 m", "0.4 m", credit=0.25),
        }
        result = judge(Told("reaches", says, points=4), scenarios=("near", "far"))
        assert result.score == 1.0
        assert result.result("reaches").decisive.scenario == "far"

    @pytest.mark.parametrize(
        ("counts", "points", "status", "shown"),
        [
            ("worst", 0.0, Status.FAILED, "drive_1"),
            ("best", 4.0, Status.PASSED, "drive_3"),
            ("median", 2.0, Status.FAILED, "drive_2"),
            ("mean", 2.0, Status.FAILED, "drive_2"),
        ],
    )
    def test_of_several_runs_that_counts_which_the_author_says(self, counts, points, status, shown):
        says = {"drive_1": FAIL, "drive_2": replace(FAIL, credit=0.5), "drive_3": PASS}
        result = judge(Told("reaches", says, points=4, counts=counts), scenarios=tuple(says))
        reaches = result.result("reaches")
        assert (reaches.points, reaches.status) == (points, status)
        assert reaches.decisive.scenario == shown

    def test_the_best_of_runs_is_not_known_while_one_could_not_be_judged(self):
        says = {"drive_1": FAIL, "drive_2": Finding.error("", "")}
        result = judge(Told("reaches", says, counts="best"), scenarios=tuple(says))
        assert result.result("reaches").status is Status.ERROR

    @pytest.mark.parametrize(
        ("counts", "says", "status"),
        [
            ("worst", (PASS, FAIL), Status.FAILED),
            ("worst", (PASS, PASS), Status.ERROR),
            ("best", (PASS, FAIL), Status.PASSED),
            ("median", (FAIL, FAIL), Status.FAILED),
            ("mean", (FAIL, FAIL), Status.ERROR),
        ],
    )
    def test_a_run_that_could_not_be_judged_leaves_open_only_what_it_can_change(
        self, counts, says, status
    ):
        error = Finding.undecided("the machine took time")
        findings = dict(zip(("a", "b", "c"), (*says, error), strict=True))
        result = judge(Told("reaches", findings, counts=counts), scenarios=tuple(findings))
        assert result.result("reaches").status is status
        again = ("c",) if status is Status.ERROR else ()
        assert result.disturbed_scenarios(Status.ERROR) == again

    def test_a_check_judges_only_the_scenarios_that_it_names(self):
        told = Told("node", scenarios=("renamed",))
        result = judge(told, scenarios=("listen", "renamed"))
        assert [subject.scenario for subject in told.asked] == ["renamed"]
        assert result.result("node").scenarios == ("renamed",)

    def test_a_check_of_the_submission_is_asked_once(self):
        told = Told("builds", subject=Subject.SUBMISSION)
        result = judge(told, scenarios=("listen", "renamed"))
        assert told.asked == [make_submission()]
        assert result.result("builds").findings[0].scenario is None

    def test_a_check_without_any_scenario_is_an_error_and_no_gift(self):
        result = judge(Told("node"), scenarios=())
        assert statuses(result) == {"node": "error"}
        observed = result.result("node").decisive.finding.observed
        assert observed == "there is no scenario that this check could judge"


class TestOurFaults:
    def test_a_check_that_raises_costs_no_point_and_keeps_its_traceback(self):
        result = judge(Told("node", KeyError("depth")), Told("topic", points=2))
        node = result.result("node")
        assert statuses(result) == {"node": "error", "topic": "passed"}
        assert not result.graded
        assert node.decisive.finding.observed == "the check itself failed: KeyError: 'depth'"
        assert node.decisive.traceback.startswith("Traceback (most recent call last):")
        assert "raise says" in node.decisive.traceback

    def test_an_error_of_a_check_without_points_leaves_the_submission_graded(self):
        result = judge(Told("shown", Finding.error("", ""), points=0), Told("node", points=2))
        assert statuses(result) == {"shown": "error", "node": "passed"}
        assert (result.graded, result.full_points, result.score) == (True, True, 2)

    def test_points_that_wait_for_an_error_without_points_are_not_graded(self):
        shown = Told("shown", Finding.error("", ""), points=0)
        assert not judge(shown, Told("node", requires=("shown",), points=2)).graded

    @pytest.mark.parametrize(
        ("says", "observed"),
        [
            (None, "the check 'told.told' returned NoneType instead of a Finding"),
            (True, "the check 'told.told' returned bool instead of a Finding"),
            (
                Finding("", verdict=Verdict.SKIPPED),
                "the check 'told.told' returned 'skipped', which only its requirements may decide",
            ),
            (
                Finding.failed("", "", credit=1.0),
                "the check 'told.told' failed with a credit of 1.0; it must be in [0, 1)",
            ),
            (
                Finding.failed("", "", credit=float("nan")),
                "the check 'told.told' failed with a credit of nan; it must be in [0, 1)",
            ),
        ],
    )
    def test_a_check_that_returns_nonsense_is_an_error(self, says, observed):
        node = judge(Told("node", says)).result("node")
        assert (node.status, node.decisive.finding.observed) == (Status.ERROR, observed)

    def test_a_missing_recording_is_an_error_that_names_the_scenario(self):
        result = judge(
            Told("node"),
            scenarios=("listen", "renamed"),
            recordings={"listen": make_recording("listen")},
        )
        decisive = result.result("node").decisive
        assert (decisive.scenario, decisive.finding.status) == ("renamed", Status.ERROR)
        assert decisive.finding.observed == "there is no recording of the scenario 'renamed'"

    @pytest.mark.parametrize(
        ("changes", "observed"),
        [
            (
                {"faults": ("the node /stranger is nobody's", "the disk is full")},
                "the node /stranger is nobody's; the disk is full",
            ),
            ({"ending": Ending.FAULT}, "the run was ended by a fault that left no message"),
            (
                {"scenario": "renamed"},
                "the recording is of another run, 'renamed' of 'ada_lovelace'",
            ),
            (
                {"submission": make_submission(id="eve", sha256="00" * 32)},
                "the recording is of another run, 'listen' of 'eve'",
            ),
        ],
    )
    def test_a_recording_that_cannot_be_trusted_is_not_judged(self, changes, observed):
        told = Told("node", FAIL)
        recording = make_recording(**({"scenario": "listen"} | changes))
        node = judge(told, recordings={"listen": recording}).result("node")
        assert told.asked == []
        assert (node.status, node.decisive.finding.observed) == (Status.ERROR, observed)

    def test_scenarios_that_the_host_disturbed_are_named_for_another_run(self):
        disturbed = Finding.error("", "the host took 0.3 s", disturbed=True)
        result = judge(
            Told("period", {"a": disturbed, "b": PASS, "c": disturbed}),
            Told("node", {"a": PASS, "b": Finding.error("", "broken"), "c": disturbed}),
            scenarios=("a", "b", "c"),
        )
        assert result.disturbed_scenarios(Status.ERROR) == ("a", "c")
        assert result.disturbed_scenarios(Status.FAILED) == ()

    @pytest.mark.parametrize(("waited_s", "again"), [(0.3, True), (0.0, False)])
    def test_where_a_held_up_robot_went_is_worth_a_second_run(self, waited_s, again):
        waits = (Disturbance(LAUNCHED_NS + 9 * NS, 0, round(waited_s * NS)),)
        run = make_recording("a", truth=drive(20), disturbance=waits)
        goal = Told("goal", FAIL, parameters=RobotParameters())
        result = judge(goal, scenarios=("a",), recordings={"a": run})
        assert result.result("goal").status is Status.FAILED
        assert result.disturbed_scenarios(Status.FAILED) == (("a",) if again else ())


class TestNotRun:
    BROKEN = BuildRecord(
        succeeded=False,
        duration_s=0.6,
        failed_packages=("bot_publisher",),
        culprit=SourceError("src/bot_publisher/setup.py", 24, "SyntaxError: '(' was never closed"),
    )

    def test_without_that_requirement_the_check_fails_and_shows_the_file_and_line(self):
        result = judge(Told("node"), submission=make_submission(build=self.BROKEN), recordings={})
        finding = result.result("node").decisive.finding
        assert (finding.status, result.graded) == (Status.FAILED, True)
        assert finding.observed.startswith("was not run because the package was not built: ")
        assert (
            "src/bot_publisher/setup.py:24: SyntaxError: '(' was never closed" in finding.observed
        )
        assert finding.evidence.places == (self.BROKEN.culprit,)

    def test_a_package_that_was_never_built_is_our_fault(self):
        submission = make_submission(build=None)
        result = judge(Told("node"), submission=submission, recordings={})
        assert result.result("node").status is Status.ERROR

    @pytest.mark.parametrize("recorded", [True, False])
    def test_a_scenario_that_launches_what_cannot_be_built_here_costs_nothing(self, recorded):
        log = (
            "Starting >>> cpp\n  Could not find a package configuration file provided by\n"
            '  "rclcpp" with any\nFailed   <<< cpp [1s, exited with code 1]\n'
        )
        lacking = BuildRecord(False, 1.0, False, False, ("cpp",), ("rclcpp",), None, log)
        python, cpp = (
            PackageRecord("bot_publisher", "bot_publisher"),
            PackageRecord("cpp", "cpp", "ament_cmake"),
        )
        rests = replace(python, imports=(Import("cpp", "bot_publisher/bot.py", 1),))
        for launched, other, expected in (
            ("cpp", python, Status.ERROR),
            ("bot_publisher", rests, Status.ERROR),
            ("bot_publisher", python, Status.FAILED if recorded else Status.ERROR),
        ):
            submission = make_submission(packages=(other, cpp), build=lacking)
            recordings = {"listen": make_recording(submission=submission)} if recorded else {}
            loaded = make_loaded([Told("node", FAIL)], launched=launched)
            finding = judge_all(loaded, submission, recordings).result("node").decisive.finding
            assert finding.status is expected
            assert ("`rclcpp`" in finding.observed) == (launched == "cpp" or other is rests)


@pytest.mark.parametrize("put_right", [True, False])
def test_what_requires_a_name_is_judged_where_the_run_put_the_name_right(put_right):
    names = Names.of([WrongName(Thing.TOPIC, "/cmdvel", "/cmd_vel")])
    run = make_recording(names=names if put_right else Names())
    checks = (Told("topic", replace(FAIL, names=names)), Told("sent", requires=("topic",)))
    result = judge(*checks, recordings={"listen": run})
    assert statuses(result) == {"topic": "failed", "sent": "passed" if put_right else "skipped"}
    assert result.names == {"listen": names}


def lacking_parameter(scenario="listen"):
    """A run that gives a parameter which no node of the student declares."""
    return make_recording(
        scenario,
        nodes=(Node("/bot", Owner.STUDENT, LAUNCHED_NS),),
        calls=(
            Call(
                "/bot/list_parameters",
                "rcl_interfaces/srv/ListParameters",
                LAUNCHED_NS,
                LAUNCHED_NS + 1,
                response={"result": {"names": ["use_sim_time"]}},
            ),
        ),
        environment={"parameters": "goal_x"},
    )


@pytest.mark.parametrize("has_check", [True, False])
def test_a_parameter_that_the_node_does_not_take_is_one_mistake_and_is_told_first(has_check):
    run = lacking_parameter()
    given = Told(
        "given", FAIL, uses="parameter.given" if has_check else "told.told", requires=("type",)
    )
    checks = (Told("goal", FAIL), Told("limits"), Told("type", PASS), given)
    result = judge(*checks, recordings={"listen": run})
    assert statuses(result)["limits"] == "passed"
    assert statuses(result)["goal"] == ("skipped" if has_check else "failed")
    if has_check:
        assert result.result("goal").waits_for == ("given",)
    else:
        seen = result.result("goal").decisive.finding.observed
        assert seen.startswith("the launch gives `goal_x`, but no node declares it; ")


def test_a_parameter_that_the_node_does_not_take_takes_no_partial_credit_away():
    runs = {name: make_recording(name) for name in ("one", "two")}
    runs["three"] = lacking_parameter("three")
    given = Told("given", FAIL, uses="parameter.given", scenarios=("three",))
    some = {"one": PASS, "two": PASS, "three": FAIL}
    error = Finding.error("a goal", "a full disk")
    checks = (
        given,
        Told("mean", some, counts="mean", points=3.0),
        Told("half", replace(FAIL, credit=0.5), scenarios=("three",)),
        Told("open", some | {"one": error}, counts="mean"),
        Told("worst", some),
    )
    result = judge(*checks, scenarios=tuple(runs), recordings=runs)
    assert statuses(result) == {
        "given": "failed",
        "mean": "failed",
        "half": "failed",
        "open": "error",
        "worst": "skipped",
    }
    assert [result.result(name).points for name in ("mean", "half", "worst")] == [2.0, 0.5, 0.0]


def test_a_name_is_put_right_only_where_the_program_that_has_it_wrong_is_launched():
    names = Names.of([WrongName(Thing.TOPIC, "/cmdvel", "/cmd_vel")])
    loaded = make_loaded(
        [Told("topic", replace(FAIL, names=names), scenarios=("one",))], ("one", "again", "other")
    )
    other = loaded.assignment.scenarios[2].model_copy(
        update={"launch": (Launch(executable="bot_sub"),)}
    )
    scenarios = (*loaded.assignment.scenarios[:2], other)
    loaded = replace(
        loaded, assignment=loaded.assignment.model_copy(update={"scenarios": scenarios})
    )
    result = judge_all(loaded, make_submission(), {"one": make_recording("one")})
    assert result.names == {"one": names, "again": names, "other": Names()}


def wrong(thing, own, asked):
    return Names.of([WrongName(thing, own, asked)])


def test_what_lies_in_the_namespace_of_a_misnamed_node_is_put_right_with_it():
    node = wrong(Thing.NODE, "/lab/bot", "/bot")
    topic = wrong(Thing.TOPIC, "/lab/cmd_vel", "/cmd_vel")
    other = wrong(Thing.SERVICE, "/ligth", "/light")
    checks = [
        Told(name, replace(FAIL, names=names))
        for name, names in (("node", node), ("topic", topic), ("service", other))
    ]
    result = judge(*checks, recordings={"listen": make_recording()})
    assert result.names == {"listen": node | other}
    # It has an absolute name.
    again = judge(*checks, recordings={"listen": make_recording(names=node)})
    assert again.names == {"listen": node | other | topic}


def test_what_another_check_asks_for_is_not_misnamed():
    loaded = make_loaded([Told("topic", replace(FAIL, names=wrong(Thing.NODE, "/bot", "/robot")))])
    result = judge_all(loaded, make_submission(), {"listen": make_recording()})
    asked = replace(result.results[0], id="node", asked_name=(Thing.NODE, "/bot"))
    assert result.names["listen"]
    assert not replace(result, results=(*result.results, asked)).names["listen"]


def test_a_launch_file_names_its_nodes_itself():
    loaded = make_loaded([Told("topic", replace(FAIL, names=wrong(Thing.NODE, "/bot", "/robot")))])
    scenario = loaded.assignment.scenarios[0].model_copy(
        update={"launch": (Launch(file="bot.launch.py"),)}
    )
    loaded = replace(
        loaded, assignment=loaded.assignment.model_copy(update={"scenarios": (scenario,)})
    )
    result = judge_all(loaded, make_submission(), {"listen": make_recording()})
    assert result.names == {"listen": Names()}


def test_a_number_that_gets_a_name_is_known_of_recordings_from_before():
    asked = Told("arrives")
    loaded = make_loaded([asked])
    [scenario] = loaded.assignment.scenarios
    named = Scenario.model_validate(
        {"id": scenario.id, "launch": scenario.launch, "timeout": "5 s", "values": {"x": 1, "y": 2}}
    )
    assignment = loaded.assignment.model_copy(update={"scenarios": (named,)})
    loaded = replace(loaded, assignment=assignment)
    judge_all(loaded, make_submission(), {"listen": make_recording(values={"y": 3.0})})
    assert asked.asked[0].values == {"x": 1, "y": 3.0}
