"""Whatever a student's services, actions and loggers answer, no check breaks on it."""

from dataclasses import replace

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from grader.checks.catalogue import CATALOGUE
from grader.checks.finding import Finding, Status
from grader.recording.event import Disturbance
from grader.recording.interaction import Feedback, Goal, Service
from grader.recording.model import Call, LogLine
from tests.checks.builder import LAUNCH_NS, NODE, died, judge, process, recording
from tests.checks.test_catalogue import PARAMETERS

FAMILIES = ("service.", "action.", "parameter.", "lifecycle.", "log.")
NAMES = [name for name in CATALOGUE if name.startswith(FAMILIES)]
TIMES = st.integers(-(10**9), 6 * 10**9).map(lambda ns: LAUNCH_NS + ns)
MAYBE = st.one_of(st.none(), TIMES)
JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=9)),
    lambda inner: st.one_of(
        st.lists(inner, max_size=2),
        st.dictionaries(
            st.sampled_from(
                [
                    "data",
                    "success",
                    "message",
                    "sequence",
                    "order",
                    "results",
                    "successful",
                    "reason",
                    "values",
                    "type",
                    "names",
                    "double_value",
                    "descriptors",
                    "name",
                    "result",
                    "current_state",
                    "label",
                    "floating_point_range",
                    "from_value",
                    "to_value",
                    "step",
                    "parameters",
                    "value",
                ]
            ),
            inner,
            max_size=3,
        ),
    ),
    max_leaves=6,
)
FIELDS = st.one_of(
    st.dictionaries(st.sampled_from(["data", "success", "names", "results", "order"]), JSON),
    st.just({"parameters": [{"name": "speed", "value": {"type": 3, "double_value": 0.9}}]}),
    st.just({"names": ["speed"]}),
    st.just({"results": [{"successful": True, "reason": ""}]}),
    st.just({"values": [{"type": 3, "double_value": 0.9}]}),
    st.just({"descriptors": [{"name": "speed", "type": 3}]}),
)
CALLS = st.builds(
    Call,
    st.sampled_from(
        [
            "/enable",
            *(
                f"{NODE}/{name}"
                for name in (
                    "list_parameters",
                    "describe_parameters",
                    "get_parameters",
                    "set_parameters",
                    "get_state",
                    "change_state",
                )
            ),
        ]
    ),
    st.just("std_srvs/srv/SetBool"),
    TIMES,
    MAYBE,
    st.one_of(st.none(), FIELDS),
    st.one_of(st.none(), FIELDS),
    st.sampled_from(["", "", "no server", "not installed"]),
)
SERVICES = st.builds(
    Service,
    st.sampled_from(
        ["/enable", "/Enable", "/fibonacci/_action/send_goal", f"{NODE}/get_state", "/a/enable"]
    ),
    st.sampled_from(["std_srvs/srv/SetBool", "x/action/Fibonacci_SendGoal", "x/srv/Y"]),
    st.sampled_from([NODE, "/other"]),
    TIMES,
)
GOALS = st.builds(
    Goal,
    st.just("/fibonacci"),
    st.just("x/action/Fibonacci"),
    st.sampled_from([{"order": 4}, {"order": -1}, {}]),
    TIMES,
    st.sampled_from([None, True, True, False]),
    MAYBE,
    st.lists(st.builds(Feedback, TIMES, FIELDS), max_size=4).map(tuple),
    st.just(()),
    st.sampled_from([None, 0.2]),
    MAYBE,
    MAYBE,
    st.sampled_from([None, True, False]),
    st.sampled_from(["", "succeeded", "canceled", "aborted", "unknown"]),
    st.one_of(st.none(), FIELDS),
    MAYBE,
    st.booleans(),
    st.booleans(),
    st.sampled_from(["", "", "no server", "not installed"]),
)
LOG = st.builds(
    LogLine,
    TIMES,
    st.sampled_from(["bot_publisher", "bot_publisher/bot_pub"]),
    st.sampled_from(["rosout", "stderr", "stdout"]),
    st.one_of(
        st.text(max_size=20),
        st.sampled_from(["ready", "[INFO] [1700000001.000000000] [bot_publisher]: ready"]),
    ),
    st.sampled_from(["", "INFO", "WARN", "FATAL", "35"]),
)


@settings(max_examples=300, suppress_health_check=[HealthCheck.too_slow], deadline=None)
@given(
    st.lists(CALLS, max_size=6).map(tuple),
    st.lists(SERVICES, max_size=4).map(tuple),
    st.lists(GOALS, max_size=3).map(tuple),
    st.lists(LOG, max_size=6).map(tuple),
    st.sampled_from([(process(),), (died(1),), (died(0),)]),
    st.lists(st.builds(Disturbance, TIMES, st.integers(0, 10**9), st.integers(0, 10**9))).map(
        lambda found: tuple(sorted(found, key=lambda item: item.time_ns))
    ),
)
def test_no_answer_breaks_a_check(calls, services, goals, log, processes, disturbance):
    run = replace(
        recording(), calls=calls, services=services, goals=goals, log=log, processes=processes,
        disturbance=disturbance,
    )  # fmt: skip
    for name in NAMES:
        finding = judge(name, run, **PARAMETERS[name])
        assert isinstance(finding, Finding)
        assert finding.expected and finding.observed
        assert (finding.credit == 1.0) == (finding.status is Status.PASSED)
