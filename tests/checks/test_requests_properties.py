"""No check breaks on any answer of a student's services and actions, or on any log."""

from dataclasses import replace

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from grader.checks.catalogue import CATALOGUE
from grader.findings.finding import Finding, Status
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
    lambda inner: st.lists(inner, max_size=2),
    max_leaves=6,
)
FIELDS = st.dictionaries(st.sampled_from(["data", "success", "sequence", "order"]), JSON)
NAME = st.sampled_from(["speed", "speeed", "qos_overrides.x"])
VALUE = st.fixed_dictionaries({"type": st.integers(0, 9), "double_value": st.floats()})
RANGE = st.fixed_dictionaries(dict.fromkeys(("from_value", "to_value", "step"), st.floats()))
DESCRIPTOR = st.fixed_dictionaries(
    {
        "name": NAME,
        "type": st.integers(0, 12),
        "read_only": st.booleans(),
        "description": st.text(max_size=9),
        "floating_point_range": st.lists(RANGE, max_size=1),
        "integer_range": st.just([]),
    }
)
RESULT = st.fixed_dictionaries({"successful": st.booleans(), "reason": st.text(max_size=9)})


def few(key, item):
    return st.fixed_dictionaries({key: st.lists(item, max_size=2)})


LABELS = {"current_state": st.fixed_dictionaries({"label": st.text(max_size=9)})}
SETTING = st.fixed_dictionaries({"name": NAME, "value": VALUE})
# Service -> its request and its response, in their types and of any length.
PARAMETER_SERVICES = {
    "list_parameters": (
        st.just({"depth": 0}),
        st.fixed_dictionaries({"result": few("names", NAME)}),
    ),
    "describe_parameters": (few("names", NAME), few("descriptors", DESCRIPTOR)),
    "get_parameters": (few("names", NAME), few("values", VALUE)),
    "set_parameters": (few("parameters", SETTING), few("results", RESULT)),
    "get_state": (st.just({}), st.fixed_dictionaries(LABELS)),
    "change_state": (st.just({"transition": {"id": 1, "label": ""}}), FIELDS),
}


def calls_to(name, request, response):
    return st.builds(
        Call,
        st.just(name),
        st.just("std_srvs/srv/SetBool"),
        TIMES,
        MAYBE,
        st.one_of(st.none(), request),
        st.one_of(st.none(), response),
        st.sampled_from(["", "", "no server", "not installed"]),
    )


CALLS = st.one_of(
    calls_to("/enable", FIELDS, FIELDS),
    *(calls_to(f"{NODE}/{name}", *parts) for name, parts in PARAMETER_SERVICES.items()),
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
        finding = judge(name, run, **PARAMETERS.get(name, {}))
        assert isinstance(finding, Finding)
        assert finding.expected and finding.observed
        assert (finding.credit == 1.0) == (finding.status is Status.PASSED)
