"""log.follows: log lines must show what the node was sent, when it was sent."""

from dataclasses import replace

import pytest

from grader.findings.finding import Status
from grader.recording.model import Endpoint, Kind, LogLine, Owner
from tests.checks.builder import (
    RELIABLE,
    call,
    declared,
    endpoint,
    failing,
    judge,
    message,
    node,
    output,
    process,
    recording,
    taken,
    traceback,
)

BOT = "/bot_subscriber"
ODOMETRY = "nav_msgs/msg/Odometry"
SCAN = "sensor_msgs/msg/LaserScan"
LATCHED = replace(RELIABLE, durability="transient_local")
POSITION = {
    "topic": "/odom",
    "fields": ["pose.pose.position.x", "pose.pose.position.y"],
    "at_least": 2,
}
FRONT = {"topic": "/scan", "fields": ["ranges[0]"], "at_least": 2}
HEADING = {"topic": "/odom", "fields": ["yaw(pose.pose.orientation)"], "at_least": 2}
# One sends from 1 s to 2 s, the other from 3 s to 4 s.
ODOM_TIMES_S = [1.0, 1.2, 1.4, 1.6, 1.8, 2.0]
SCAN_TIMES_S = [3.0, 3.2, 3.4, 3.6, 3.8, 4.0]
X, Y, AHEAD, LEFT, BEHIND = 1.372, -0.618, 1.834, 0.618, 2.5
RANGES = [AHEAD, *[LEFT] * 90, *[2.0] * 89, BEHIND, *[3.0] * 179]


def odometry(x=X, y=Y):
    return {
        "child_frame_id": "base_footprint",
        "pose": {
            "pose": {
                "position": {"x": x, "y": y, "z": 0.0},
                "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
            },
            "covariance": [1e-5, *[0.0] * 35],
        },
        "twist": {"twist": {"linear": {"x": 0.25, "y": 0.0, "z": 0.0}}},
    }


def scan():
    return {"range_min": 0.12, "range_max": 3.5, "ranges": list(RANGES), "intensities": []}


def sent(topic, type, value, times_s):
    return tuple(
        message(t, value, sequence=n, topic=topic, type=type)
        for n, t in enumerate(times_s, start=1)
    )


def scanned(value):
    """Messages of these values on /scan alone."""
    return {"messages": {"/scan": sent("/scan", SCAN, value, SCAN_TIMES_S)}}


def ranging(*ranges):
    """Scans with these ranges on /scan alone."""
    return scanned({**scan(), "ranges": list(ranges)})


def subscription(topic="/odom", type=ODOMETRY, qos=RELIABLE):
    return endpoint(topic, kind=Kind.SUBSCRIPTION, type=type, node=BOT, qos=qos)


def publisher(topic="/odom", type=ODOMETRY, qos=RELIABLE) -> Endpoint:
    return endpoint(topic, type=type, node="/probe", owner=Owner.PROBE, qos=qos)


def lines(text, times_s, delay_s=0.01):
    return tuple(line for t in times_s for line in output(text, time_s=t + delay_s))


def run(log: tuple[LogLine, ...] = (), **changes):
    """A subscriber that spins, is sent odometry first and scans then, and writes these lines."""
    healthy = {
        "submission": recording().submission,
        "messages": {
            "/odom": sent("/odom", ODOMETRY, odometry(), ODOM_TIMES_S),
            "/scan": sent("/scan", SCAN, scan(), SCAN_TIMES_S),
        },
        "nodes": (node(BOT), node("/probe", 0.0, owner=Owner.PROBE)),
        "endpoints": (
            subscription(),
            subscription("/scan", SCAN),
            publisher(),
            publisher("/scan", SCAN),
        ),
        "declarations": (declared("started", 0.05), declared("node", 0.3), declared("spin", 0.41)),
        "calls": tuple(call(0.5 * index, of=BOT) for index in range(1, 9)),
        "log": tuple(sorted(log, key=lambda line: line.time_ns)),
    }
    return recording(**{**healthy, **changes})


def position(log=(), **changes):
    return failing("log.follows", run(log, **changes), **POSITION)


def front(log=(), **changes):
    return failing("log.follows", run(log, **changes), **FRONT)


class TestExpressions:
    @pytest.mark.parametrize("text", ["heading: 3.14", "heading: -3.14"])
    def test_a_heading_is_what_follows_from_the_quaternion_on_the_circle(self, text):
        backwards = odometry()
        backwards["pose"]["pose"]["orientation"] = {"x": 0.0, "y": 0.0, "z": 1.0, "w": 0.0}
        messages = {"/odom": sent("/odom", ODOMETRY, backwards, ODOM_TIMES_S)}
        followed = run(lines(text, ODOM_TIMES_S), messages=messages)
        assert judge("log.follows", followed, **HEADING).status is Status.PASSED
        wrong = run(lines("heading: 1.57", ODOM_TIMES_S), messages=messages)
        assert "yaw(pose.pose.orientation)" in judge("log.follows", wrong, **HEADING).expected
        assert judge("log.follows", wrong, **HEADING).status is Status.FAILED


class TestAnyFormatIsRight:
    @pytest.mark.parametrize(
        "text",
        [
            "[INFO] [1700000000.123456789] [bot]: Position: x = 1.37, y = -0.62",
            "1.372 -0.618",
            "(1.37,-0.61)",
            "x:1.37y:-0.62",
            '{"x": 1.372, "y": -0.618}',
            "x: 1,37; y: -0,62",
            "x = 1.37, y = \N{MINUS SIGN}0.62",
            "1.372e+00|-6.18e-01",
            "geometry_msgs.msg.Point(x=1.372, y=-0.618, z=0.0)",
            "x: 1.372\ny: -0.618",
            "Position:\n\tx\n1.4e3 1.372\n\ty\n-0.618",
            "\x1b[32mx=1.37\x1b[0m y=-0.62",
            "y -0.62 x 1.37",
            "y = -0.62, x = 1.37",
            "x, y: 1.37, -0.62",
            "(y, x) = (-0.62, 1.37)",
            "1.37 x -0.62 y",
            "in the map x = -0.62, y = 1.37; in odom x = 1.37, y = -0.62",
        ],
    )
    def test_two_numbers_in_any_words_pass(self, text):
        finding = judge("log.follows", run(lines(text, ODOM_TIMES_S)), **POSITION)
        assert finding.status is Status.PASSED, finding
        assert "follow 6 of 6 messages" in finding.observed
        assert finding.evidence.log[0] == text.splitlines()[0]

    @pytest.mark.parametrize(
        "text",
        [
            "front 1.83 m",
            "front-1.83",
            "1.834000",
            "array('f', [1.834, 0.5])",
            "range=+1.84",
            "1,83",
        ],
    )
    def test_one_number_in_any_words_passes(self, text):
        finding = judge("log.follows", run(lines(text, SCAN_TIMES_S)), **FRONT)
        assert finding.status is Status.PASSED, finding

    @pytest.mark.parametrize(
        "text",
        [
            *("765,072", "765_072", "Received: 765,072.", "765,072, 5", "n=+765_072.0"),
            *("765 072", "12: 765 072.", "765'072", "765\N{RIGHT SINGLE QUOTATION MARK}072"),
            *("765\N{NO-BREAK SPACE}072", "765\N{NARROW NO-BREAK SPACE}072"),
        ],
    )
    def test_of_a_number_whose_digits_are_grouped(self, text):
        grouped = run(lines(text, SCAN_TIMES_S), **ranging(765072.0, *RANGES[1:]))
        assert judge("log.follows", grouped, **FRONT).status is Status.PASSED

    @pytest.mark.parametrize(
        "text", ["765,07", "1765,072", "765,0722", "765_072_1", "0.765,072", "765  072", "1765 072"]
    )
    def test_other_digits_are_no_groups(self, text):
        found = front(lines(text, SCAN_TIMES_S), **ranging(765072.0, *RANGES[1:]))
        assert "none shows" in found or "1000 times too small" in found

    def test_what_is_printed_counts_as_well(self):
        log = tuple(replace(line, stream="stdout") for line in lines("1.37 -0.62", ODOM_TIMES_S))
        assert judge("log.follows", run(log), **POSITION).status is Status.PASSED

    def test_of_a_beam_that_measures_nothing(self):
        changed = ranging(float("inf"), *RANGES[1:])
        good = run(lines("[INFO] [1.5] [bot]: Front: inf", SCAN_TIMES_S), **changed)
        assert judge("log.follows", good, **FRONT).status is Status.PASSED
        bad = run(lines("[INFO] [1.5] [bot]: information", SCAN_TIMES_S), **changed)
        assert "none shows `ranges[0]` = inf" in failing("log.follows", bad, **FRONT)


class TestAnyRhythmIsRight:
    def test_not_every_message_needs_a_line(self):
        finding = judge("log.follows", run(lines("1.37 -0.62", [1.0, 2.0])), **POSITION)
        assert finding.status is Status.PASSED
        assert "follow 2 of 6 messages" in finding.observed

    def test_a_timer_may_log_also_when_no_message_comes_any_more(self):
        log = lines("1.37 -0.62", [0.5 + 0.3 * index for index in range(12)])
        assert judge("log.follows", run(log), **POSITION).status is Status.PASSED

    def test_one_line_does_not_stand_for_many_messages(self):
        found = position(lines("1.37 -0.62", [1.0]))
        assert "log lines follow only 1 of 6 messages on `/odom`" in found
        assert "Log in every call of the callback" in found

    @pytest.mark.parametrize(
        ("text", "served"),
        [
            ("765072 765073 765074 765075 765076 ", 5),
            ("765073; 765074; 765075; ", 3),
            ("n=765075, n=765076", 2),
            ("765072 765074 765073", 1),
            ("765072 765073 17", 1),
            ("765072 765072", 1),
        ],
    )
    def test_a_line_that_lists_messages_stands_for_each(self, text, served):
        values = [{"data": 765072 + index} for index in range(len(SCAN_TIMES_S))]
        changed = tuple(
            message(t, value, topic="/scan", type=SCAN)
            for t, value in zip(SCAN_TIMES_S, values, strict=True)
        )
        log = lines(text, [SCAN_TIMES_S[-1] + 0.1])
        asked = {**FRONT, "fields": ["data"], "within": "5 s", "at_least": served}
        changes = {"messages": {"/scan": changed}}
        assert judge("log.follows", run(log, **changes), **asked).status is Status.PASSED
        asked["at_least"] += 1
        assert f"only {served} of" in failing("log.follows", run(log, **changes), **asked)

    def test_a_callback_that_sleeps_keeps_the_others_waiting(self):
        log = lines("1.83", [3.9])
        slow = front(log, calls=tuple(call(0.5 * n, 1.0, of=BOT) for n in range(1, 7)))
        assert "only 1 of 6 messages on `/scan`" in slow
        assert "the node's parameter service waited 1 s or more" in slow
        assert "A callback must return soon" in slow
        lost = (*(call(0.5 * n, of=BOT) for n in range(2, 7)), call(0.5, None, of=BOT))
        assert "waited" not in front(log) and "waited" not in front(log, calls=lost)

    def test_values_that_change_must_be_those_of_the_message(self):
        values = [odometry(x=1.0 + 0.1 * index) for index in range(6)]
        changed = tuple(
            message(t, value, topic="/odom", type=ODOMETRY)
            for t, value in zip(ODOM_TIMES_S, values, strict=True)
        )
        fresh = tuple(
            line
            for index, t in enumerate(ODOM_TIMES_S)
            for line in lines(f"{1.0 + 0.1 * index:.2f} -0.62", [t])
        )
        good = judge("log.follows", run(fresh, messages={"/odom": changed}), **POSITION)
        assert "follow 6 of 6 messages" in good.observed
        stale = lines("1.00 -0.62", ODOM_TIMES_S)
        assert "only 1 of 6" in failing(
            "log.follows", run(stale, messages={"/odom": changed}), **POSITION
        )

    def test_where_every_message_must_be_logged_less_often_is_no_advice(self):
        kept_apart = lines("1.37 -0.62", ODOM_TIMES_S[1:])
        found = failing("log.follows", run(kept_apart), **{**POSITION, "at_least": 6})
        assert "only 5 of 6" in found
        assert "skip_first=True" in found

    def test_lines_that_come_too_seldom(self):
        once = [1.0 + 0.2 * index for index in range(16)]
        messages = {"/odom": sent("/odom", ODOMETRY, odometry(), once)}
        asked = {**POSITION, "every": "1.5 s"}
        for times_s in ([1.0, 2.0, 3.0, 4.0], [1.9, 2.9, 3.9], [2.4, 3.8]):
            run_ = run(lines("1.37 -0.62", times_s), messages=messages)
            assert judge("log.follows", run_, **asked).status is Status.PASSED
        for times_s, since in (([1.0, 3.0], "1.01"), ([2.8, 3.4], "1.00"), ([1.0, 2.2], "2.21")):
            seldom = run(lines("1.37 -0.62", times_s), messages=messages)
            found = failing("log.follows", seldom, **asked)
            assert f"from {since} s after launch on" in found
            assert "Log in every call" in found
        waiting = (call(1.1, 1.9, BOT), call(1.6, 1.4, BOT), call(2.1, 0.9, BOT))
        asleep = run(lines("1.37 -0.62", [1.0, 3.0]), messages=messages, calls=waiting)
        found = failing("log.follows", asleep, **asked)
        assert "calls to the node's parameter service waited 1.4 s or more" in found
        assert "A callback must return soon" in found and "Log in every call" not in found
        machine = run(
            lines("1.37 -0.62", [1.0, 3.0]), messages=messages,
            disturbance=taken(1.0, 3.0, waited_s=0.8),
        )  # fmt: skip
        finding = judge("log.follows", machine, **asked)
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)
        assert "no such line for 2 s, from 1.01 s after launch on" in finding.observed
        # What waited then is worked on later.
        before = replace(machine, disturbance=taken(0.3, 1.0, waited_s=0.6))
        assert judge("log.follows", before, **asked).status is Status.ERROR

    def test_a_line_must_come_soon(self):
        late = lines("1.83", SCAN_TIMES_S, delay_s=0.15)
        assert judge("log.follows", run(late), **FRONT).status is Status.PASSED
        finding = judge("log.follows", run(late), **FRONT, within="100 ms")
        assert finding.status is Status.FAILED


class TestOtherValues:
    @pytest.mark.parametrize(
        "text", ["[INFO] [1.1] [bot]: x = -0.62, y = 1.37", '{"y": 1.372, "x": -0.618}']
    )
    def test_x_and_y_exchanged(self, text):
        assert "none shows `pose.pose.position.x` = 1.37" in position(lines(text, ODOM_TIMES_S))

    @pytest.mark.parametrize("text", ["x = -0.62, y = 1.37", "x: -0.62\ny: 1.37"])
    def test_exchanged_names_are_reported(self, text):
        found = position(lines(text, ODOM_TIMES_S))
        assert "`pose.pose.position.x` and `pose.pose.position.y` are swapped" in found

    def test_a_right_line_beside_an_exchanged_one_counts(self):
        text = "x = -0.62, y = 1.37\nx = 1.37, y = -0.62"
        finding = judge("log.follows", run(lines(text, ODOM_TIMES_S)), **POSITION)
        assert finding.status is Status.PASSED

    def test_what_is_written_at_ctrl_c_answers_no_message(self):
        log = lines("2.50", SCAN_TIMES_S) + output(traceback("KeyboardInterrupt"), time_s=4.25)
        found = front(log, stop_s=4.2)
        assert "none shows `ranges[0]` = 1.83: `2.50`" in found
        assert "File" not in found and "Traceback" not in found

    def test_z_in_place_of_y(self):
        found = position(lines("1.37 0.0", ODOM_TIMES_S))
        assert "none shows `pose.pose.position.y` = -0.62: `1.37 0.0`" in found
        assert "`pose.pose.position.x`" not in found

    @pytest.mark.parametrize(
        ("text", "braces"),
        [
            ("x = {p.x:.2f}, y = {p.y:.2f}", "{p.x:.2f}"),
            ("[INFO] [1700000000.1] [bot]: at {msg.pose.pose.position!r}", "{msg.pose"),
            ("{self.where()} {y}", "{self.where()}"),
        ],
    )
    def test_an_f_string_without_its_f(self, text, braces):
        found = position(lines(text, ODOM_TIMES_S))
        assert f"they show `{braces}" in found and "instead of a value" in found
        assert "an f stands before the quotes" in found

    @pytest.mark.parametrize("text", ['{"x": 9.5}', "{'y': 9.5}", "{9.5}", "{}"])
    def test_other_braces_are_no_f_string(self, text):
        assert "an f stands" not in position(lines(text, ODOM_TIMES_S))

    def test_nothing_is_kept_of_the_loggers_own_numbers(self):
        assert "none shows" in front(lines("[INFO] [1.834] [bot]: hello", SCAN_TIMES_S))


class TestWhatKeepsLinesBack:
    def test_lines_of_several_threads_in_another_order(self):
        values = (1.25, 2.5, 3.75, 4.5)
        sent_ = tuple(
            message(1.0 + n / 100, odometry(x), sequence=n, topic="/odom", type=ODOMETRY)
            for n, x in enumerate(values, start=1)
        )
        asked = {"topic": "/odom", "fields": ["pose.pose.position.x"], "at_least": 4}
        shuffled = [f"x {x}" for x in (3.75, 1.25, 4.5, 2.5)]
        for texts, status in ((shuffled, Status.PASSED), (["x 1.25", *shuffled[:3]], "failed")):
            log = tuple(
                line for n, one in enumerate(texts) for line in output(one, time_s=1.1 + n / 1000)
            )
            assert (
                judge("log.follows", run(log, messages={"/odom": sent_}), **asked).status == status
            )

    def test_one_of_two_subscriptions_that_matches_is_enough_to_look_further(self):
        endpoints = (subscription(qos=LATCHED), subscription(), publisher())
        assert "nothing is logged" in position(endpoints=endpoints)

    def test_an_executor_that_another_callback_blocks(self):
        calls = (call(0.5, of=BOT), call(1.5, None, of=BOT), call(2.0, None, of=BOT))
        found = front(lines("1.37 -0.62", ODOM_TIMES_S), calls=calls)
        assert "something blocks the executor" in found
        assert "from 1.50 s after launch on the node's parameter service does not answer" in found
        assert "Look for a loop" in found
        busy = taken(1.0, 4.0, waited_s=2.0)
        assert "blocks the executor" in front(
            lines("1.37 -0.62", [1.0]), calls=calls, disturbance=busy
        )

    def test_an_executor_that_answers_is_not_blocked(self):
        calls = (call(1.5, None, of=BOT), call(3.2, of=BOT))
        assert "nothing is logged" in front(calls=calls)

    def test_a_node_that_publishes_the_topic_itself(self):
        forged = endpoint("/odom", type=ODOMETRY, node=BOT)
        log = lines("1.37 -0.62", ODOM_TIMES_S)
        found = position(log, endpoints=(subscription(), forged, publisher()))
        assert "the node itself publishes on `/odom`" in found


class TestNotTheStudentsFault:
    def errs(self, subject, parameters=FRONT):
        finding = judge("log.follows", subject, **parameters)
        assert finding.status is Status.ERROR, finding
        return finding

    def test_a_message_that_was_never_sent_costs_nothing(self):
        finding = self.errs(run(messages={"/odom": run().on("/odom")}))
        assert "nothing was sent on `/scan`" in finding.observed and finding.disturbed

    def test_too_little_was_sent(self):
        messages = {"/scan": sent("/scan", SCAN, scan(), [3.0])}
        finding = self.errs(run(lines("1.83", [3.0]), messages=messages))
        assert "only 1 message was sent on `/scan`" in finding.observed

    def test_lines_that_the_host_made_late(self):
        log = lines("1.83", [3.99, 4.49])
        assert judge("log.follows", run(log), **FRONT, within="300 ms").status is Status.FAILED
        finding = self.errs(
            run(log, disturbance=taken(2.9, 4.4, waited_s=0.3)), {**FRONT, "within": "300 ms"}
        )
        assert finding.disturbed and "the machine took up to 300 ms" in finding.observed

    def test_output_that_was_not_kept(self):
        finding = self.errs(run(processes=(process(dropped_bytes=1000),)))
        assert "1000 bytes more" in finding.observed

    @pytest.mark.parametrize(
        ("field", "words"),
        [
            ("range[0]", "no field 'range'"),
            ("ranges[360]", "360 items, so there is no [360]"),
            ("ranges", "ranges is not a number"),
            ("range_max.x", "range_max has no field 'x'"),
        ],
    )
    def test_a_field_that_the_message_does_not_have(self, field, words):
        finding = self.errs(run(), {"topic": "/scan", "fields": [field]})
        assert "the assignment expects what cannot be" in finding.observed
        assert words in finding.observed


def test_a_message_on_rosout_does_not_count_besides_its_line():
    log = lines("1.83", [3.0])
    log += tuple(replace(line, stream="rosout", level="INFO") for line in log)
    assert "follow only 1 of 6" in front(log)


SAID = {"topic": "/chatter", "fields": ["number(data)"], "at_least": 2, "own": True}


class TestOwn:
    """log.follows of what the student publishes."""

    def talker(self, log=(), **changes):
        texts = [{"data": f"Hello World: {number}"} for number in range(10, 16)]
        said = zip(ODOM_TIMES_S, texts, strict=True)
        messages = tuple(
            message(t, value, topic="/chatter", type="std_msgs/msg/String") for t, value in said
        )
        own = endpoint("/chatter", type="std_msgs/msg/String", node=BOT)
        return run(log, messages={"/chatter": messages}, endpoints=(own,), **changes)

    def logged(self, text, delay_s):
        return tuple(
            line
            for number, time_s in enumerate(ODOM_TIMES_S, start=10)
            for line in output(text.format(number), time_s=time_s + delay_s)
        )

    @pytest.mark.parametrize("delay_s", [-0.05, 0.05])
    def test_a_node_that_logs_what_it_publishes_before_or_after_it_passes(self, delay_s):
        found = judge("log.follows", self.talker(self.logged("I say {}", delay_s)), **SAID)
        assert found.status is Status.PASSED

    @pytest.mark.parametrize(
        ("log", "words"),
        [
            ("", "no log line shows a message on `/chatter`"),
            ("published", "none shows `number(data)` = 15"),
        ],
    )
    def test_a_node_that_does_not_log_it_fails_and_is_not_told_to_subscribe(self, log, words):
        lines = self.logged(log, 0.05) if log else ()
        found = failing("log.follows", self.talker(lines), **SAID)
        assert words in found
        assert "subscri" not in found

    def test_a_node_that_publishes_nothing_is_told_so(self):
        silent = run(messages={}, endpoints=())
        assert "publish" in failing("log.follows", silent, **SAID)
