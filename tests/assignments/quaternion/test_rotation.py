"""rotation.answers: right in any style, wrong by name, paired fairly."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from assignments.quaternion.checks.case import rows
from assignments.quaternion.checks.common_mistakes import MISTAKES
from assignments.quaternion.checks.conversion import CONVERSIONS, Group, angles_between, oracle
from grader.assignment.load import find_assignment
from grader.assignment.own_check import load_function
from grader.findings.finding import Status
from tests.checks.builder import (
    died,
    endpoint,
    failing,
    judge,
    message,
    output,
    recording,
    taken,
    text,
    traceback,
)

ASKED = {
    "axis_angle_to_quaternion": ("/axis_angle", "/quaternion"),
    "rpy_to_quaternion": ("/rpy", "/orientation"),
    "quaternion_to_rpy": ("/quaternion_in", "/rpy_out"),
}
HALF = math.sqrt(0.5)
STEP_S = 0.02
FOLDER = find_assignment("quaternion").parent


def cases_of(function, seed):
    """Messages of the assignment's own function."""
    return load_function(f"cases.py:{function}", FOLDER)(seed)


def question(conversion, row):
    if conversion == "axis_angle_to_quaternion":
        return {"data": [float(value) for value in row]}
    return dict(zip("xyzw", map(float, row), strict=False))


def answer(row):
    return dict(zip("xyzw", map(float, row), strict=False))


def run(conversion, asked, answered, *, late_s=0.001, step_s=STEP_S, stop_s=None, **changes):
    """A run in which each question is sent some time (seconds) after the one before.

    Args:
        asked: Rows of questions.
        answered: A row per question, a list of rows, or None for no answer.
    """
    topic, answers = ASKED[conversion]
    sent, received = [], []
    for index, (row, found) in enumerate(zip(asked, answered, strict=True)):
        time_s = 1.0 + step_s * index
        sent.append(message(time_s, question(conversion, row), sequence=index + 1, topic=topic))
        several = isinstance(found, list) and not np.isscalar(found[0])
        many = found if several else [] if found is None else [found]
        for copy, each in enumerate(many):
            received.append(
                message(
                    time_s + late_s + 0.0001 * copy,
                    answer(each),
                    sequence=len(received) + 1,
                    topic=answers,
                )
            )
    stop_s = stop_s or 1.0 + step_s * len(asked) + late_s + 0.5
    defaults = {
        "sent": {topic: tuple(sent)},
        "messages": {answers: tuple(received)} if received else {},
        "stop_s": stop_s,
        "endpoints": (endpoint(answers),),
    }
    return recording(**{**defaults, **changes})


def parameters(conversion, **more):
    topic, answers = ASKED[conversion]
    return {"stimulus": topic, "topic": answers, "conversion": conversion, **more}


def judged(conversion, asked, answered, with_=None, **changes):
    return judge(
        "rotation.answers", run(conversion, asked, answered, **changes),
        **parameters(conversion, **(with_ or {})),
    )  # fmt: skip


def failed(conversion, asked, answered, with_=None, **changes):
    return failing(
        "rotation.answers", run(conversion, asked, answered, **changes),
        **parameters(conversion, **(with_ or {})),
    )  # fmt: skip


def asked_of(function, seed=1):
    """Rows of the assignment's own cases."""
    conversion = {
        "axis_angle": "axis_angle_to_quaternion",
        "zero_axis": "axis_angle_to_quaternion",
        "rpy": "rpy_to_quaternion",
    }.get(function, "quaternion_to_rpy")
    sent = [message(1.0, value) for value in cases_of(function, seed)]
    return conversion, rows(sent, CONVERSIONS[conversion].asks)


def right(conversion, asked):
    rotations = Rotation.from_quat(oracle(conversion, np.asarray(asked, dtype=float)))
    if conversion == "quaternion_to_rpy":
        # scipy warns at gimbal lock and sets the third angle to 0.
        import warnings

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return list(rotations.as_euler("xyz"))
    return list(rotations.as_quat())


# --- The lecture's examples, worked out by hand ----------------------------------------------

QUARTER_X = ([1, 0, 0, math.pi / 2], [HALF, 0, 0, HALF])
ABOUT_101 = ([1, 0, 1, math.pi / 2], [0.5, 0, 0.5, HALF])


class TestByHand:
    def test_a_quarter_turn_about_x_and_one_about_1_0_1(self):
        finding = judged("axis_angle_to_quaternion", *zip(QUARTER_X, ABOUT_101, strict=True))
        assert finding.status is Status.PASSED
        assert finding.observed.startswith("all of 2 cases right, largest error")

    def test_three_turns_about_fixed_axes_agree(self):
        # Roll 90 about x, then yaw 90 about the fixed z: x goes to y, y to z, z to x.
        third = [0.5, 0.5, 0.5, 0.5]
        asked = [math.pi / 2, 0, math.pi / 2]
        assert judged("rpy_to_quaternion", [asked], [third]).status is Status.PASSED
        assert judged("quaternion_to_rpy", [third], [asked]).status is Status.PASSED

    def test_the_same_rotation_with_other_signs(self):
        asked, answered = QUARTER_X
        negative = [-value for value in answered]
        assert judged("axis_angle_to_quaternion", [asked], [negative]).status is Status.PASSED

    def test_other_angles_of_the_same_rotation(self):
        asked = [HALF, 0, 0, HALF]
        other = [math.pi / 2 + math.pi, math.pi, -math.pi]
        assert judged("quaternion_to_rpy", [asked], [other]).status is Status.PASSED

    def test_gimbal_lock_leaves_a_choice(self):
        # At a pitch of 90 deg only yaw - roll counts.
        asked = list(Rotation.from_euler("xyz", [0.4, math.pi / 2, 1.0]).as_quat())
        for roll in (0.0, 0.4, -2.0):
            finding = judged("quaternion_to_rpy", [asked], [[roll, math.pi / 2, roll + 0.6]])
            assert finding.status is Status.PASSED
        words = failed("quaternion_to_rpy", [asked], [[0.6, math.pi / 2, 0.0]])
        assert "roll 0 deg, pitch 90 deg, yaw 34.38 deg, or other angles" in words
        assert "roll 0 and yaw 2 * math.atan2(z, w)" in words

    def test_a_quaternion_of_another_length_is_the_same_rotation(self):
        answered = [math.pi / 2, 0, 0]
        assert judged("quaternion_to_rpy", [[5, 0, 0, 5]], [answered]).status is Status.PASSED

    def test_the_answer_must_have_length_1(self):
        asked, answered = QUARTER_X
        words = failed("axis_angle_to_quaternion", [asked], [[1.00001 * v for v in answered]])
        assert "length is not 1 (it is 1.00001 to 1.00001)" in words
        almost = [[(1 + 5e-7) * v for v in answered]]
        assert judged("axis_angle_to_quaternion", [asked], almost).status is Status.PASSED


# --- Zero axis, zero quaternion ---------------------------------------------------------------


class TestZero:
    ZERO = ([0, 0, 0, 1.0],)
    CASES = (QUARTER_X[0], [0, 0, 0, 1.0], ABOUT_101[0])

    def with_zero(self, middle):
        return [QUARTER_X[1], middle, ABOUT_101[1]]

    @pytest.mark.parametrize("middle", [None, [0, 0, 0, 1], [0, 0, 0, -1]])
    def test_no_rotation_or_nothing(self, middle):
        finding = judged("axis_angle_to_quaternion", self.CASES, self.with_zero(middle))
        assert finding.status is Status.PASSED

    @pytest.mark.parametrize(
        ("middle", "why"),
        [
            ([math.nan, math.nan, math.nan, 0.5], "is not a number"),
            ([0, 0, 0, math.inf], "is not a number"),
            ([0, 0, 0, math.cos(0.5)], "length 0.8776"),
            ([0, 0, 0, 0], "length 0"),
            # What rclpy makes of Quaternion(x=0, y=0, z=0, w=1).
            ([0, 0, 0, 5e-324], "but an integer, a text or a numpy.float32 was put into it"),
            # And of numpy.float32(0.7071) in a field.
            ([5.239e-315, 0, 0, 0], "but an integer, a text or a numpy.float32 was put into it"),
            ([HALF, 0, 0, HALF], "instead of no rotation or no answer"),
        ],
    )
    def test_anything_else_is_wrong(self, middle, why):
        words = failed("axis_angle_to_quaternion", self.CASES, self.with_zero(middle))
        assert "1 of 3 cases wrong" in words
        assert why in words

    def test_the_way_out_is_that_of_a_zero_axis(self):
        # As of an axis that was divided by its length and a little.
        half = [0, 0, 0, math.cos(0.5)]
        words = failed("axis_angle_to_quaternion", self.CASES, self.with_zero(half))
        assert "test whether the length is 0 before you divide by it" in words
        assert "normalize" not in words.lower()

    def test_a_node_that_ends_of_it_gets_the_reason(self):
        words = failed(
            "axis_angle_to_quaternion", self.CASES, [QUARTER_X[1], None, None],
            processes=(died(1, 1.03),),
            log=output(traceback("ZeroDivisionError: float division by zero")),
        )  # fmt: skip
        assert "1 of 3 cases without an answer" in words
        assert "ZeroDivisionError" in words
        assert "node.py:14" in words

    def test_a_zero_quaternion_is_answered_by_no_rotation(self):
        asked = [[0, 0, 0, 0], [HALF, 0, 0, HALF]]
        quarter = [math.pi / 2, 0, 0]
        for zero in (None, [0, 0, 0]):
            assert judged("quaternion_to_rpy", asked, [zero, quarter]).status is Status.PASSED
        words = failed("quaternion_to_rpy", asked, [[math.nan] * 3, quarter])
        assert "is not a number" in words


# --- Names for mistakes -----------------------------------------------------------------------


ORDINARY = {
    "axis_angle_to_quaternion": "axis_angle",
    "rpy_to_quaternion": "rpy",
    "quaternion_to_rpy": "quaternion",
}
# What only other cases show.
ELSEWHERE = {"the quaternion is not scaled to length 1 before": "scaled"}


@pytest.mark.parametrize("seed", [1])
@pytest.mark.parametrize(
    ("conversion", "mistake"),
    [(name, mistake) for name, mistakes in MISTAKES.items() for mistake in mistakes],
    ids=lambda item: item if isinstance(item, str) else item.words[:40],
)
def test_each_mistake_fails_and_is_named(conversion, mistake, seed):
    function = ELSEWHERE.get(mistake.words, ORDINARY[conversion])
    _, asked = asked_of(function, seed)
    words = failed(conversion, asked, list(mistake.formula(asked)))
    assert mistake.words in words
    assert str(mistake.hint) in words


def test_what_has_no_name_gets_none():
    _, asked = asked_of("quaternion")
    crooked = [row + np.array([0.01, 0.02, 0.03]) for row in right("quaternion_to_rpy", asked)]
    words = failed("quaternion_to_rpy", asked, crooked)
    assert "60 of 60 cases wrong; case 1" in words


@pytest.mark.parametrize(("index", "name"), [(0, "roll"), (1, "pitch"), (2, "yaw")])
def test_the_only_wrong_angle_is_named(index, name):
    _, asked = asked_of("quaternion")
    answers = [list(row) for row in right("quaternion_to_rpy", asked)]
    for number, row in enumerate(answers):
        row[index] += 0.3 + 0.01 * number
    words = failed("quaternion_to_rpy", asked, answers)
    assert f"are right, the {name} is not" in words
    assert f"{name} = a" in words


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    ("function", "margin"), [("quaternion", 0.99), ("gimbal_lock", 0.999), ("gimbal_lock", 0.9999)]
)
def test_gimbal_lock_that_is_seen_too_early_is_found_for_every_seed(function, margin, seed):
    _, asked = asked_of(function, seed)
    answers = [list(row) for row in right("quaternion_to_rpy", asked)]
    for (x, y, z, w), row in zip(asked, answers, strict=True):
        if abs(sine := 2.0 * (w * y - z * x)) > margin:
            row[:] = [0.0, math.copysign(0.5 * math.pi, sine), 2.0 * math.atan2(z, w)]
    words = failed("quaternion_to_rpy", asked, answers, {"tolerance": "0.1 deg"})
    assert "answered as at gimbal lock" in words and "abs(sin_pitch) > 0.9999999" in words


def test_a_short_axis_that_is_taken_for_a_zero_one():
    conversion, asked = asked_of("axis_angle")
    answers = [
        [0, 0, 0, 1] if math.hypot(*row[:3]) < 0.5 else answered
        for row, answered in zip(asked, right(conversion, asked), strict=True)
    ]
    words = failed(conversion, asked, answers)
    assert "the answer is no rotation at all" in words and "such as a short axis" in words


@pytest.mark.parametrize("seed", range(5))
def test_a_small_angle_that_is_taken_for_none_is_no_matter_of_degrees(seed):
    conversion, asked = asked_of("axis_angle", seed)
    answers = [
        [0, 0, 0, 1] if abs(row[3]) < 1e-3 else answered
        for row, answered in zip(asked, right(conversion, asked), strict=True)
    ]
    words = failed(conversion, asked, answers, {"cases": ["ordinary"]})
    assert "the answer is no rotation at all" in words and "a small angle" in words


@pytest.mark.parametrize(
    ("function", "is_zero"),
    [
        ("axis_angle", lambda row: sum(row[:3]) == 0.0),
        ("axis_angle", lambda row: max(row[:3]) == 0.0),
        ("quaternion", lambda row: sum(row) == 0.0),
        ("quaternion", lambda row: row[3] == 0.0),
    ],
)
@pytest.mark.parametrize("seed", range(5))
def test_the_cases_find_who_tests_for_zero_in_a_wrong_way(function, is_zero, seed):
    conversion, asked = asked_of(function, seed)
    nothing = [0, 0, 0] if function == "quaternion" else [0, 0, 0, 1]
    answers = [
        nothing if is_zero(row) else answered
        for row, answered in zip(asked, right(conversion, asked), strict=True)
    ]
    assert "the answer is no rotation at all" in failed(conversion, asked, answers)


def test_the_same_answer_to_everything():
    _, asked = asked_of("axis_angle")
    words = failed("axis_angle_to_quaternion", asked, [[0, 0, 0, 1]] * len(asked))
    assert "every answer is the same" in words


def test_right_answers_on_another_topic_are_found_there():
    conversion, asked = asked_of("rpy")
    answered = right(conversion, asked)
    exchanged = run(conversion, asked, answered)
    words = failing(
        "rotation.answers",
        replace(
            exchanged,
            messages={
                "/quaternion": exchanged.on("/orientation"),
                "/orientation": run(conversion, asked, answered[::-1]).on("/orientation"),
            },
        ),
        **parameters(conversion),
    )
    assert "the answers to `/rpy` are right, but come on `/quaternion`" in words
    assert "term by term" not in words


def test_a_quaternion_has_no_pole_to_be_tested_for():
    asked = [[0.3, math.pi / 2, 1.0], [0.2, 0.1, 0.5]]
    answered = right("rpy_to_quaternion", asked)
    words = failed("rpy_to_quaternion", asked, [[0.0, 0.0, 0.0, 1.0], answered[1]])
    assert "0.9999999" not in words


def test_a_length_of_1_is_not_blamed():
    asked = [[0, 0, 1, 1.0], [0, 0, 1, 2.0]]
    answered = right("axis_angle_to_quaternion", [[0, 0, 1, 1.0005], [0, 0, 1, 2.0005]])
    words = failed("axis_angle_to_quaternion", asked, answered)
    assert "a little off" in words and "length is not 1" not in words


def test_answers_that_belong_to_the_message_before():
    conversion, asked = asked_of("axis_angle")
    stale = [[0, 0, 0, 1], *right(conversion, asked)[:-1]]
    words = failed(conversion, asked, stale)
    assert "each answer belongs to the message before" in words


# --- Right in every style ---------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    "function",
    ["axis_angle", "zero_axis", "rpy", "quaternion", "scaled", "gimbal_lock", "zero_quaternion"],
)
def test_the_oracle_itself_is_right_for_every_seed(function, seed):
    conversion, asked = asked_of(function, seed)
    assert judged(conversion, asked, right(conversion, asked)).status is Status.PASSED


def single_precision_quaternion(asked):
    row = np.asarray(asked, dtype=np.float32)
    length = np.linalg.norm(row[:3])
    axis = row[:3] / length if length else row[:3]
    half = row[3] / np.float32(2)
    return [*(axis * np.sin(half)), np.cos(half)] if length else [0, 0, 0, 1]


def single_precision_rpy(asked, margin=0.99999):
    row = np.asarray(asked, dtype=np.float32)
    length = np.linalg.norm(row)
    if not length:
        return [0, 0, 0]
    x, y, z, w = row / length
    two, one = np.float32(2), np.float32(1)
    sine = np.clip(two * (w * y - z * x), -one, one)
    if abs(sine) > margin:
        return [0.0, math.copysign(math.pi / 2, sine), two * np.arctan2(z, w)]
    return [
        np.arctan2(two * (w * x + y * z), one - two * (x * x + y * y)),
        np.arcsin(sine),
        np.arctan2(two * (w * z + x * y), one - two * (y * y + z * z)),
    ]


def matrix_rpy(asked):
    """By a rotation matrix, as tf_transformations does it."""
    length = math.hypot(*asked)
    if not length:
        return [0, 0, 0]
    x, y, z, w = (value / length for value in asked)
    m00, m10, m20 = 1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)
    m21, m22 = 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    m11, m12 = 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    cosine = math.hypot(m00, m10)
    if cosine > 1e-12:
        return [math.atan2(m21, m22), math.atan2(-m20, cosine), math.atan2(m10, m00)]
    return [math.atan2(-m12, m11), math.atan2(-m20, cosine), 0.0]


def margin_of_the_angle_rpy(asked):
    """At gimbal lock where the pitch, not its sine, is within a thousandth of 90 deg."""
    return single_precision_rpy(asked, margin=math.cos(0.001))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("style", [single_precision_rpy, matrix_rpy, margin_of_the_angle_rpy])
@pytest.mark.parametrize("function", ["quaternion", "scaled", "gimbal_lock", "zero_quaternion"])
def test_right_code_with_rounding_errors_passes(function, style, seed):
    """The tolerances are wide enough for single precision, and for margins at gimbal lock."""
    conversion, asked = asked_of(function, seed)
    tolerance = "0.1 deg" if function == "gimbal_lock" else "0.01 deg"
    finding = judged(conversion, asked, [style(row) for row in asked], {"tolerance": tolerance})
    assert finding.status is Status.PASSED, finding.observed


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("function", ["axis_angle", "zero_axis"])
def test_answers_of_single_precision_are_right(function, seed):
    conversion, asked = asked_of(function, seed)
    answers = [single_precision_quaternion(row) for row in asked]
    finding = judged(conversion, asked, answers)
    assert finding.status is Status.PASSED, finding.observed


@pytest.mark.parametrize("seed", range(5))
def test_the_usual_formula_alone_fails_at_gimbal_lock(seed):
    conversion, asked = asked_of("gimbal_lock", seed)

    def usual(row, limit, scale):
        length = math.hypot(*row) if scale else 1.0
        x, y, z, w = (value / length for value in row)
        sine = 2 * (w * y - z * x)
        if abs(sine) >= limit:
            return [0, math.copysign(math.pi / 2, sine), 2 * math.atan2(z, w)]
        return [
            math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
            math.asin(max(-1.0, min(1.0, sine))),
            math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
        ]

    for limit, scale in itertools.product((math.inf, 1.0), (False, True)):
        answers = [usual(row, limit, scale) for row in asked]
        words = failed(conversion, asked, answers, {"tolerance": "0.1 deg"})
        assert "roll 0 and yaw 2 * math.atan2(z, w)" in words


# --- Pairing and silence ----------------------------------------------------------------------


class TestPairing:
    conversion, asked = asked_of("axis_angle")
    answers = right(conversion, asked)

    def test_late_answers_are_reported(self):
        finding = judged(self.conversion, self.asked, self.answers, late_s=0.75)
        assert finding.status is Status.PASSED

    def test_doubled_answers_are_reported(self):
        doubled = [[one, one] for one in self.answers]
        assert judged(self.conversion, self.asked, doubled).status is Status.PASSED

    @pytest.mark.parametrize("copies", [3, 4, 10])
    def test_an_answer_that_comes_several_times_passes(self, copies):
        several = [[one] * copies for one in self.answers]
        assert judged(self.conversion, self.asked, several).status is Status.PASSED

    def test_an_answer_that_is_repeated_when_nothing_is_asked(self):
        answers = [*self.answers[:-1], [self.answers[-1]] * 6]
        words = failed(self.conversion, self.asked, answers)
        assert "case 100 was answered 6 times" in words
        assert "once for each message, and not in a timer" in words

    def test_one_missing_answer_is_one_missing_answer(self):
        answers = [*self.answers[:10], None, *self.answers[11:]]
        words = failed(self.conversion, self.asked, answers)
        assert "1 of 100 cases without an answer, the first: case 11" in words

    def test_a_wrong_answer_besides_the_right_one(self):
        answers = [[one, [0.6, 0.0, 0.0, 0.8]] for one in self.answers]
        assert "100 of 100 cases wrong" in failed(self.conversion, self.asked, answers)

    def test_an_answer_that_got_lost_on_its_way_is_our_fault(self):
        healthy = run(self.conversion, self.asked, self.answers)
        received = healthy.messages["/quaternion"]
        broken = run(
            self.conversion, self.asked, self.answers,
            messages={"/quaternion": (*received[:10], *received[11:])},
        )  # fmt: skip
        finding = judge("rotation.answers", broken, **parameters(self.conversion))
        assert finding.status is Status.ERROR
        assert finding.disturbed
        assert "1 answer got lost on the way" in finding.observed

    def test_a_question_right_before_the_end_needs_no_answer(self):
        answers = [*self.answers[:-1], None]
        stop_s = 1.0 + STEP_S * len(answers)
        finding = judged(self.conversion, self.asked, answers, stop_s=stop_s)
        assert finding.status is Status.PASSED

    def test_a_machine_that_takes_the_time_costs_no_point(self):
        answers = [*self.answers[:-1], None]
        end_s = 1.0 + STEP_S * len(answers)
        finding = judged(
            self.conversion, self.asked, answers,
            stop_s=end_s + 0.4, disturbance=taken(end_s, end_s + 0.1, waited_s=0.3),
        )  # fmt: skip
        assert finding.status is Status.ERROR
        assert finding.disturbed


class TestUnasked:
    def with_early(self, count):
        healthy = run("axis_angle_to_quaternion", [QUARTER_X[0]], [QUARTER_X[1]])
        early = tuple(
            message(0.5 + 0.05 * index, answer([0, 0, 0, 1]), sequence=index + 1)
            for index in range(count)
        )
        return {"messages": {"/quaternion": (*early, *healthy.on("/quaternion"))}}

    def test_messages_without_a_question_are_reported(self):
        words = failed(
            "axis_angle_to_quaternion", [QUARTER_X[0]], [QUARTER_X[1]], **self.with_early(6)
        )
        assert "6 messages on `/quaternion` before anything was asked on `/axis_angle`" in words

    def test_a_greeting_does_no_harm(self):
        finding = judged(
            "axis_angle_to_quaternion", [QUARTER_X[0]], [QUARTER_X[1]], **self.with_early(1)
        )
        assert finding.status is Status.PASSED


class TestSilence:
    def test_no_answer_at_all(self):
        words = failed("rpy_to_quaternion", [[1, 0, 0]] * 3, [None] * 3)
        assert "/orientation" in words

    def test_nothing_was_sent_without_a_subscription(self):
        words = failed(
            "rpy_to_quaternion", [[1, 0, 0]], [None],
            sent={"/rpy": ()}, endpoints=(endpoint("/orientation"),),
        )  # fmt: skip
        assert "created no subscription" in words

    def test_fewer_cases_than_needed(self):
        finding = judged(
            "axis_angle_to_quaternion", [QUARTER_X[0]], [QUARTER_X[1]], {"at_least": 5}
        )
        assert finding.status is Status.ERROR
        assert "only 1 case of 5 could be sent" in finding.observed

    def test_fewer_cases_than_needed_because_the_callback_sleeps(self):
        conversion, asked = asked_of("axis_angle")
        few = asked[:10]
        # The next question follows the answer. Those of other lengths come last, and are not
        # asked at all.
        slow = {"late_s": 0.29, "step_s": 0.3}
        needed = {"cases": ["scaled"], "at_least": 30}
        words = failed(conversion, few, right(conversion, few), needed, **slow)
        assert "only 0 cases of 30 could be sent, because the answers come late" in words
        assert "no time.sleep()" in words
        finding = judged(
            conversion, few, right(conversion, few), needed,
            disturbance=taken(1.0, 4.0, waited_s=2.8), **slow,
        )  # fmt: skip
        assert finding.status is Status.ERROR

    def test_only_cases_of_a_kind_are_judged(self):
        conversion, asked = asked_of("axis_angle")
        mistake = next(m for m in MISTAKES[conversion] if m.words == "the axis is not normalized")
        answers = list(mistake.formula(asked))
        only = judged(conversion, asked, answers, {"cases": ["ordinary"]})
        assert only.status is Status.PASSED
        assert "all of 50 cases right" in only.observed
        assert "50 cases wrong" in failed(conversion, asked, answers, {"cases": ["scaled"]})


class TestEvidence:
    def test_the_error_of_each_case_in_degrees(self):
        asked = [QUARTER_X[0], ABOUT_101[0], [0, 0, 0, 1]]
        finding = judged("axis_angle_to_quaternion", asked, [[0, 0, 0, 1], ABOUT_101[1], None])
        drawn = finding.evidence.cases[0]
        assert drawn.label == "error of the rotation (deg)"
        assert drawn.limit == pytest.approx(0.01)
        assert [case.group for case in drawn.cases] == ["ordinary", "scaled", "zero"]
        assert drawn.cases[0].error == pytest.approx(90.0)
        assert drawn.cases[1].error == pytest.approx(0.0, abs=1e-6)
        assert drawn.cases[2].error is None
        assert finding.evidence.tables[0].rows[0][:2] == ("1", "90 deg about (1, 0, 0)")

    def test_a_finding_shows_no_numbers_without_unit(self):
        asked, _ = QUARTER_X
        words = text(judged("axis_angle_to_quaternion", [asked], [[0, 0, 0, 1]]))
        assert "90 deg about (1, 0, 0), gave x = 0, y = 0, z = 0, w = 1" in words


# --- The assignment's cases -------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_the_cases_are_what_the_checks_count_on(seed):
    groups = {
        "axis_angle": {Group.ORDINARY: 50, Group.SCALED: 50},
        "rpy": {Group.ORDINARY: 59, Group.GIMBAL_LOCK: 11},
        "quaternion": {Group.ORDINARY: 60},
        "scaled": {Group.SCALED: 30},
        "gimbal_lock": {Group.GIMBAL_LOCK: 30, Group.ORDINARY: 8},
        "zero_axis": {Group.ZERO: 3, Group.ORDINARY: 9},
        "zero_quaternion": {Group.ZERO: 2, Group.ORDINARY: 6},
    }
    for function, expected in groups.items():
        conversion, asked = asked_of(function, seed)
        kinds = [CONVERSIONS[conversion].group(row) for row in asked.tolist()]
        assert {kind: kinds.count(kind) for kind in set(kinds)} == expected


def test_another_seed_gives_other_cases_and_the_same_seed_the_same():
    assert cases_of("axis_angle", 1) == cases_of("axis_angle", 1)
    assert cases_of("axis_angle", 1) != cases_of("axis_angle", 2)


unit_quaternions = (
    st.lists(st.floats(-1, 1), min_size=4, max_size=4)
    .filter(lambda row: math.hypot(*row) > 0.1)
    .map(lambda row: np.array(row) / math.hypot(*row))
)


@settings(max_examples=50)
@given(unit_quaternions, st.floats(0, math.pi), unit_quaternions)
def test_the_angle_between_rotations(start, angle, direction):
    axis = direction[:3]
    if np.linalg.norm(axis) < 0.1:
        axis = np.array([1.0, 0.0, 0.0])
    turn = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis))
    turned = (turn * Rotation.from_quat(start)).as_quat()
    found = angles_between(np.array([start]), np.array([turned, -turned]))
    assert found[0] == pytest.approx([angle, angle], abs=2e-7)
