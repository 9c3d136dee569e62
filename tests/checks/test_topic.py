"""topic.published, topic.subscribed and topic.type: near misses are explained."""

from dataclasses import replace

import pytest

from grader.findings.finding import Status
from grader.recording.event import Intervention
from grader.recording.model import Ending, Kind, Owner
from grader.spec.names import Names, Thing, WrongName
from tests.checks.builder import (
    BOT,
    NODE,
    TWIST,
    at,
    call,
    declarations,
    declared,
    died,
    endpoint,
    failing,
    judge,
    messages,
    nodeless,
    output,
    process,
    reader,
    recording,
    silent,
    taken,
    traceback,
)

OWN = (
    endpoint("/rosout", type="rcl_interfaces/msg/Log"),
    endpoint("/parameter_events", type="rcl_interfaces/msg/ParameterEvent"),
)


def with_endpoints(*endpoints, **changes):
    return silent(
        **{
            "endpoints": (*OWN, *endpoints, reader()),
            "declarations": declarations()[:3],
            **changes,
        }
    )


def ended_at(
    time_s, *more, kind=Kind.PUBLISHER, spun_s=0.6, number=7, brief="", processes=None, **changes
):
    """A run in which an endpoint on /cmd_vel was destroyed at a time; it was made at 0.3 s."""
    about = {"node": NODE, "topic": "/cmd_vel", "depth": 10, "number": number}
    told = (
        declared("node", 0.25, node=NODE),
        declared(kind.value, 0.3, **about, brief=brief == "made"),
        declared("destroyed", time_s, number=number, brief=brief == "destroyed"),
        declared("spin", spun_s, executor="SingleThreadedExecutor"),
    )
    gone = endpoint(kind=kind, vanished_ns=at(time_s))
    more = {"declarations": (*told, *more), "processes": processes or (process(),), **changes}
    return with_endpoints(gone, **more)


CMDVEL = Names.of([WrongName(Thing.TOPIC, "/cmdvel", "/cmd_vel")])


class TestRemap:
    """A wrong name costs the points of one check."""

    def rule(self, *endpoints, **changes):
        run = with_endpoints(*endpoints, **changes)
        names = judge("topic.published", run, topic="/cmd_vel", remap=True).names
        return " ".join(map(str, names.wrong))

    def test_the_one_topic_of_the_right_type_is_taken_for_the_one_that_was_meant(self):
        assert self.rule(endpoint("/cmdvel")) == "/cmdvel:=/cmd_vel"
        assert self.rule(endpoint("/speed")) == "/speed:=/cmd_vel"

    def test_an_unclear_name_is_never_guessed(self):
        assert not self.rule()
        assert not self.rule(endpoint("/cmdvel", type="geometry_msgs/msg/Vector3"))
        assert not self.rule(endpoint("/cmdvel"), endpoint("/speed"))
        assert not self.rule(endpoint("/cmdvel"), reader("/cmdvel"))

    def test_a_name_that_is_none_becomes_no_argument(self):
        assert not self.rule(endpoint("/cmd -r __node"))

    def test_a_rule_that_did_not_help_is_not_tried_again(self):
        assert not self.rule(endpoint("/cmdvel"), names=CMDVEL)

    def test_it_is_off_unless_the_author_wants_it(self):
        run = with_endpoints(endpoint("/cmdvel"))
        assert not judge("topic.published", run, topic="/cmd_vel").names

    @pytest.mark.parametrize("check", ["topic.published", "topic.type"])
    def test_in_the_run_that_puts_it_right_the_name_is_still_wrong(self, check):
        run = recording(names=CMDVEL)
        more = {"type": TWIST} if check == "topic.type" else {}
        finding = judge(check, run, topic="/cmd_vel", remap=True, **more)
        assert (finding.status, finding.names) == (Status.FAILED, CMDVEL)
        assert finding.observed.startswith("found `/cmdvel` instead")


class TestPublished:
    def test_a_publisher_on_the_topic_passes_though_nothing_came(self):
        assert judge("topic.published", silent(), topic="/cmd_vel").status is Status.PASSED

    def test_a_message_proves_a_publisher_that_the_graph_never_showed(self):
        run = recording(endpoints=(reader(),))
        assert judge("topic.published", run, topic="/cmd_vel").status is Status.PASSED

    def test_a_message_of_the_simulator_proves_nothing(self):
        simulator = endpoint(node="/simulator", owner=Owner.PROBE)
        run = recording(endpoints=(simulator, reader()), declarations=())
        assert "created no publisher" in failing("topic.published", run, topic="/cmd_vel")

    def test_one_that_ends_with_the_constructor_fails_and_what_it_published_is_judged(self):
        finding = judge("topic.published", ended_at(0.4), topic="/cmd_vel")
        assert finding.status is Status.FAILED and not finding.stands_alone
        heard = ended_at(0.4, messages=messages([0.35]))
        assert judge("topic.published", heard, topic="/cmd_vel").stands_alone
        assert "destroyed 0.40 s after launch, while the process still ran" in finding.observed

    @pytest.mark.parametrize("spun_s", [0.2, 0.6])
    def test_one_that_is_destroyed_where_it_was_made_is_found_before_and_after_spinning(
        self, spun_s
    ):
        assert "only for a moment" in failing(
            "topic.published", ended_at(0.4, spun_s=spun_s), topic="/cmd_vel"
        )

    @pytest.mark.parametrize(
        "waited",
        [declared("held", 1.9, topic="/cmd_vel"), declared("leaving", 0.4), declared("none", 0.4)],
    )
    def test_what_the_tracer_or_the_machine_waits_makes_no_moment_longer(self, waited):
        slow = taken(0.4, 2.0, waited_s=1.5) if waited.kind == "none" else ()
        run = ended_at(2.0, waited, spun_s=0.1, disturbance=slow)
        assert "only for a moment" in failing("topic.published", run, topic="/cmd_vel")

    @pytest.mark.parametrize(
        "run",
        [
            # A callback destroys what the constructor kept.
            lambda: ended_at(2.0),
            # main() creates it while a thread spins, sends for seconds, and destroys it.
            lambda: ended_at(2.0, spun_s=0.1),
            # It destroys what it has, and ends.
            lambda: ended_at(4.2, spun_s=4.4),
            lambda: ended_at(0.4, processes=(died(0, 0.8),), ending=Ending.EXITED),
            # Another is kept.
            lambda: ended_at(0.4, declared("publisher", 0.5, topic="/cmd_vel", number=8)),
            # A lifecycle node was asked to clean up.
            lambda: ended_at(2.0, spun_s=0.1, calls=(call(1.0, of="/change"),)),
            # The scenario ended it.
            lambda: ended_at(0.4, interventions=(Intervention(at(0.3), BOT, "kill", "SIGKILL"),)),
            # The tracer does not tell which one.
            lambda: ended_at(0.4, number=None),
        ],
    )
    def test_one_that_ends_on_purpose_was_there(self, run):
        assert judge("topic.published", run(), topic="/cmd_vel").status is Status.PASSED

    def test_relative_names_are_refused_in_the_assignment(self):
        with pytest.raises(ValueError, match="'cmd_vel' is relative"):
            judge("topic.published", recording(), topic="cmd_vel")

    @pytest.mark.parametrize(
        ("there", "topic", "words"),
        [
            (endpoint("/cmdvel"), "/cmd_vel", "publishes on `/cmdvel` instead of `/cmd_vel`"),
            (
                endpoint("/turtle1/cmdvel"),
                "/turtle1/cmd_vel",
                "the name like this: `self.create_publisher(Type, 'turtle1/cmd_vel', 10)`",
            ),
            (endpoint("/Cmd_Vel"), "/cmd_vel", "upper and lower case differ"),
            (
                endpoint("/bot_publisher/cmd_vel"),
                "/cmd_vel",
                "Leave out `~/`, which puts the node's name in front",
            ),
            (endpoint("/robot/cmd_vel"), "/cmd_vel", "`/robot` stands in front of the name"),
            (
                endpoint("/robot/cmd_vel", node="/robot/bot_publisher"),
                "/cmd_vel",
                "and any other namespace",
            ),
            (
                endpoint(kind=Kind.SUBSCRIPTION),
                "/cmd_vel",
                "self.create_publisher(Twist, 'cmd_vel', 10)",
            ),
            (OWN[0], "/cmd_vel", "`/bot_publisher` created no publisher"),
            (endpoint("/turtle1/drive"), "/cmd_vel", "the type is right on `/turtle1/drive`"),
            (
                endpoint("/chatter", type="std_msgs/msg/String"),
                "/cmd_vel",
                "created publishers only for `/chatter`",
            ),
        ],
    )
    def test_what_is_there_instead_is_reported(self, there, topic, words):
        assert words in failing("topic.published", with_endpoints(there), topic=topic)

    def test_a_death_before_the_publisher_was_created(self):
        run = with_endpoints(
            processes=(died(1),),
            ending=Ending.EXITED,
            log=output(traceback("NameError: name 'Twist' is not defined")),
        )
        found = failing("topic.published", run, topic="/cmd_vel")
        assert "NameError: name 'Twist' is not defined" in found

    def test_a_near_miss_explains_more_than_a_later_death(self):
        run = with_endpoints(endpoint("/cmdvel"), processes=(died(1),), ending=Ending.EXITED)
        assert "`/cmdvel` instead" in failing("topic.published", run, topic="/cmd_vel")

    def test_a_topic_of_a_running_process_is_no_misspelling_of_one_of_an_ended_process(self):
        run = with_endpoints(
            endpoint("/cmd_vel_raw"),
            processes=(process(), died(1, name="bot/driver")),
            declarations=declarations(),
            log=output(traceback("ValueError: no speed"), name="bot/driver"),
        )
        found = failing("topic.published", run, topic="/cmd_vel")
        assert "the process `bot/driver` ended 1.20 s after launch with ValueError" in found

    def test_without_a_node_the_reason_for_that_is_given(self):
        run = nodeless(processes=(died(-11),), ending=Ending.EXITED)
        assert "SIGSEGV" in failing("topic.published", run, topic="/cmd_vel")

    def test_declared_but_never_seen_is_excused_by_a_busy_machine_only(self):
        run = with_endpoints(declarations=declarations(), processes=(process(),))
        assert "never appeared" in failing("topic.published", run, topic="/cmd_vel")
        run = replace(run, disturbance=taken(0.1, 1.0, waited_s=0.6))
        finding = judge("topic.published", run, topic="/cmd_vel")
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)

    def test_the_evidence_lists_what_there_is(self):
        finding = judge("topic.published", with_endpoints(endpoint("/cmdvel")), topic="/cmd_vel")
        assert finding.evidence.tables[0].rows == ((NODE, "publisher", "/cmdvel", TWIST),)
        assert finding.evidence.moments[0].time_s == pytest.approx(0.3)


class TestSubscribed:
    def test_a_subscription_to_the_topic_passes(self):
        run = with_endpoints(endpoint("/scan", kind=Kind.SUBSCRIPTION))
        assert judge("topic.subscribed", run, topic="/scan").status is Status.PASSED

    @pytest.mark.parametrize(
        ("there", "words"),
        [
            (OWN[0], "created no subscription"),
            (endpoint("/scan"), "created no subscription"),
            (
                endpoint("/scann", kind=Kind.SUBSCRIPTION),
                "subscribes to `/scann` instead of `/scan`",
            ),
        ],
    )
    def test_what_is_there_instead_is_reported(self, there, words):
        assert words in failing("topic.subscribed", with_endpoints(there), topic="/scan")

    def test_one_that_ends_with_the_constructor_was_never_seen(self):
        run = ended_at(0.4, kind=Kind.SUBSCRIPTION)
        run = replace(run, endpoints=OWN)
        found = failing("topic.subscribed", run, topic="/cmd_vel")
        assert "the subscription to `/cmd_vel` was destroyed 0.40 s after launch" in found

    @pytest.mark.parametrize("brief", ["made", "destroyed"])
    def test_one_of_wait_for_message_is_brief_by_nature(self, brief):
        run = ended_at(0.4, kind=Kind.SUBSCRIPTION, brief=brief)
        assert judge("topic.subscribed", run, topic="/cmd_vel").status is Status.PASSED

    def test_messages_of_others_on_the_topic_prove_no_subscription(self):
        run = recording(endpoints=(reader(),))
        assert "created no subscription" in failing("topic.subscribed", run, topic="/cmd_vel")


class TestType:
    def test_a_topic_of_the_type_passes(self):
        finding = judge("topic.type", recording(), topic="/cmd_vel", type=TWIST)
        assert finding.status is Status.PASSED

    def test_one_wrong_publisher_of_two_fails(self):
        run = with_endpoints(endpoint(), endpoint(type="std_msgs/msg/String"))
        found = failing("topic.type", run, topic="/cmd_vel", type=TWIST)
        assert "another publisher on the topic has the type `std_msgs/msg/String`" in found

    def test_without_a_publisher_the_near_miss_is_explained(self):
        run = with_endpoints(endpoint("/cmdvel"))
        assert "`/cmdvel` instead" in failing("topic.type", run, topic="/cmd_vel", type=TWIST)

    def test_the_type_of_a_subscription(self):
        scan = "sensor_msgs/msg/LaserScan"
        run = with_endpoints(endpoint("/scan", type=scan, kind=Kind.SUBSCRIPTION))
        finding = judge("topic.type", run, topic="/scan", type=scan, kind="subscription")
        assert finding.status is Status.PASSED

    def test_a_short_interface_name_is_refused_with_the_full_one(self):
        with pytest.raises(ValueError, match="Did you mean 'geometry_msgs/msg/Twist'"):
            judge("topic.type", recording(), topic="/cmd_vel", type="geometry_msgs/Twist")
