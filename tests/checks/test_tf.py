"""tf.*: static and moving transforms, where they are, and the tree that they make."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from grader.findings.finding import Status
from grader.measure import transforms
from grader.recording.model import Message, Qos, Recording
from tests.checks.builder import (
    LAUNCH_NS,
    at,
    declarations,
    declared,
    died,
    drive,
    endpoint,
    failing,
    judge,
    message,
    output,
    process,
    recording,
    stimulus,
    taken,
    traceback,
)

TF, TF_STATIC, TYPE = "/tf", "/tf_static", transforms.TRANSFORMS
LATCHED = Qos("reliable", "transient_local", liveliness="automatic")
TIMES = [0.7 + 0.05 * index for index in range(60)]
ODOM = {"parent": "odom", "child": "base_footprint"}
SCAN = {"parent": "base_link", "child": "laser"}
PLACED = {**SCAN, "position": [0.1, 0, 0.2], "rpy": [0, 0, "90 deg"]}
TURNED = (0.0, 0.0, math.sin(math.pi / 4), math.cos(math.pi / 4))


def transform(
    parent: str = "odom",
    child: str = "base_footprint",
    place: Iterable[float] = (0.0, 0.0, 0.0),
    turn: Iterable[float] | None = None,
    stamp_s: float | None = None,
) -> dict[str, Any]:
    """A geometry_msgs/msg/TransformStamped; without a stamp that is 0."""
    sec, nanosec = divmod(0 if stamp_s is None else at(stamp_s), 10**9)
    return {
        "header": {"frame_id": parent, "stamp": {"sec": sec, "nanosec": nanosec}},
        "child_frame_id": child,
        "transform": {
            "translation": dict(zip("xyz", place, strict=True)),
            "rotation": dict(zip("xyzw", turn or (0.0, 0.0, 0.0, 1.0), strict=True)),
        },
    }


def on(topic: str, *sent: tuple[float, list[dict[str, Any]]]) -> tuple[Message, ...]:
    """Messages with transforms, each with the time of its publishing."""
    return tuple(
        message(time_s, {"transforms": items}, sequence=n, topic=topic, type=TYPE)
        for n, (time_s, items) in enumerate(sent, start=1)
    )


def run(**changes: Any) -> Recording:
    """A node that publishes on /tf and /tf_static; ``moving`` and ``static`` are the messages."""
    found = {TF: changes.pop("moving", ()), TF_STATIC: changes.pop("static", ())}
    found |= changes.pop("more", {})
    qos = changes.pop("qos", LATCHED)
    ends = (endpoint(TF, type=TYPE), endpoint(TF_STATIC, type=TYPE, qos=qos))
    return recording(
        messages={topic: items for topic, items in found.items() if items},
        **{"endpoints": ends, **changes},
    )


def static_run(*items: dict[str, Any], **changes: Any) -> Recording:
    return run(static=on(TF_STATIC, (0.7, list(items))), **changes)


def arc(time_s: float) -> tuple[float, float, float]:
    """A robot on a circle across the wrap: x, y and heading."""
    heading = 2.0 + 0.9 * (time_s - 0.7)
    return math.sin(heading), -math.cos(heading), math.remainder(heading, math.tau)


def facing(yaw: float) -> tuple[float, ...]:
    return tuple(transforms.quaternion(0.0, 0.0, yaw).values())


def pose_of(time_s: float) -> dict[str, Any]:
    x, y, heading = arc(time_s)
    return {"place": (x, y, 0.0), "turn": facing(heading)}


def broadcasting(
    of: Callable[[float], dict[str, Any]] = pose_of,
    times_s: Iterable[float] = TIMES,
    stamp: Callable[[float], float | None] = lambda time_s: time_s,
    names: tuple[str, str] = ("odom", "base_footprint"),
    **changes: Any,
) -> Recording:
    """A node that broadcasts odom -> base_footprint, and the odometry that it is made of."""
    sent = [(t, [transform(*names, stamp_s=stamp(t), **of(t))]) for t in times_s]
    odometry = [
        message(t - 0.01, odometry_of(t), sequence=n, topic="/odom", type="nav_msgs/msg/Odometry")
        for n, t in enumerate(TIMES, start=1)
    ]
    return run(moving=on(TF, *sent), more={"/odom": tuple(odometry)}, **changes)


def odometry_of(time_s: float) -> dict[str, Any]:
    pose = pose_of(time_s)
    position, turn = (dict(zip(axes, pose[key], strict=True)) for axes, key in AXES)
    return {"header": {}, "pose": {"pose": {"position": position, "orientation": turn}}}


AXES = (("xyz", "place"), ("xyzw", "turn"))


CRASH: dict[str, Any] = {"processes": (died(1),), "log": output(traceback("KeyError: 'x'"))}


class TestStatic:
    def test_a_latched_transform_with_the_right_values_passes(self) -> None:
        right = transform("base_link", "laser", (0.1, 0.0, 0.2), TURNED)
        assert judge("tf.static", static_run(right), **PLACED).status is Status.PASSED

    def test_the_negative_quaternion_and_a_full_turn_more_are_the_same_rotation(self) -> None:
        back = transform("base_link", "laser", (0.1, 0.0, 0.2), tuple(-part for part in TURNED))
        for rpy in ([0, 0, "90 deg"], [0, 0, "-270 deg"], ["180 deg", "180 deg", "-90 deg"]):
            parameters = {**PLACED, "rpy": rpy}
            assert judge("tf.static", static_run(back), **parameters).status is Status.PASSED

    def test_a_camera_that_looks_straight_down_is_judged_although_its_angles_are_not_unique(
        self,
    ) -> None:
        down = transforms.quaternion(0.3, math.pi / 2, 0.3).values()
        subject = static_run(transform("base_link", "laser", (0.1, 0.0, 0.2), down))
        right = {**PLACED, "rpy": [0, "90 deg", 0]}
        assert judge("tf.static", subject, **right).status is Status.PASSED
        failing("tf.static", subject, **{**right, "rpy": [0, "80 deg", 0]})

    def test_a_volatile_publisher_fails_and_names_transient_local(self) -> None:
        right = transform("base_link", "laser", (0.1, 0.0, 0.2), TURNED)
        volatile = Qos("reliable", "volatile", liveliness="automatic")
        found = failing("tf.static", static_run(right, qos=volatile), **PLACED)
        assert "durability volatile offered" in found and "TRANSIENT_LOCAL" in found

    @pytest.mark.parametrize(("depth", "publishers"), [(1, 1), (2, 1), (1, 2)])
    def test_a_later_message_must_not_take_its_place(self, depth: int, publishers: int) -> None:
        right = transform("base_link", "laser", (0.1, 0.0, 0.2), TURNED)
        sent = on(TF_STATIC, (0.7, [right]), (0.8, [transform("base_link", "camera")]))
        queue = {"topic": TF_STATIC, "history": "keep_last", "depth": depth}
        subject = run(
            static=sent,
            declarations=(*declarations(), *(declared("publisher", **queue),) * publishers),
        )
        if depth == publishers == 1:
            found = failing("tf.static", subject, **PLACED)
            assert "keeps 1 message, and published others after it" in found
        else:
            assert judge("tf.static", subject, **PLACED).status is Status.PASSED

    def test_where_the_machine_kept_the_publisher_from_its_match_the_run_is_repeated(self) -> None:
        robot = transform("odom", "base_footprint")
        held = declared("held", topic=TF_STATIC, matched=False)
        busy = taken(0.1, 1.0, waited_s=0.9)
        subject = static_run(robot, declarations=(*declarations(), held), disturbance=busy)
        finding = judge("tf.static", subject, **PLACED)
        assert (finding.status, finding.disturbed) == (Status.ERROR, True)

    def test_another_process_may_end(self) -> None:
        right = transform("base_link", "laser", (0.1, 0.0, 0.2), TURNED)
        other = died(0, name="bot_publisher/once")
        subject = static_run(right, processes=(other, process()))
        assert judge("tf.static", subject, **PLACED).status is Status.PASSED

    def test_a_node_that_ends_after_it_sent_fails(self) -> None:
        right = transform("base_link", "laser", (0.1, 0.0, 0.2), TURNED)
        found = failing("tf.static", static_run(right, processes=(died(0),)), **PLACED)
        assert "its publisher is gone" in found

    @pytest.mark.parametrize(
        ("place", "turn", "words"),
        [
            ((0.0, 0.1, 0.2), TURNED, "translation.x = 0.0 instead of 0.1"),
            ((100.0, 0.0, 200.0), TURNED, "1000 times too large: look at the units"),
            ((0.1, 0.0, -0.2), TURNED, "translation.z has the wrong sign"),
            ((0.1, 0.0, 0.2), (0.0, 0.0, -TURNED[2], TURNED[3]), "rotation.z has the wrong sign"),
            ((0.1, 0.0, 0.2), (0.0, 0.0, 0.0, 1.0), "rotation.z = 0.0 instead of"),
            ((0.1, 0.0, 0.2), (0.0, 0.0, 0.0, 0.0), "(0, 0, 0, 0) does not have the length 1"),
            ((0.1, 0.0, 0.2), (0.0, 0.0, TURNED[2], 0.0), "w is not set"),
            ((0.1, 0.0, 0.2), (0.0, 0.0, TURNED[2], 1.0), "w is not set"),
            ((math.nan, 0.0, 0.2), TURNED, "tf2 ignores the transform"),
            ((0.1, 0.0, 0.2), (1.3e154,) * 4, "tf2 ignores the transform"),
            ((0.1, 0.0, 0.2), (math.inf, 0.0, math.nan, 1.0), "tf2 ignores the transform"),
        ],
    )
    def test_wrong_numbers_are_explained(self, place: Any, turn: Any, words: str) -> None:
        subject = static_run(transform("base_link", "laser", place, turn))
        assert words in failing("tf.static", subject, **PLACED)

    @pytest.mark.parametrize(
        ("names", "words"),
        [
            (("laser", "base_link"), "parent and child are exchanged"),
            (("/base_link", "/laser"), "without slashes"),
            (("base_link", "lazer"), "is there instead"),
            (("base_footprint", "laser"), "`base_footprint` → `laser`"),
            (("map", "odom"), "no other than those of `odom`"),
        ],
    )
    def test_another_transform_is_named(self, names: tuple[str, str], words: str) -> None:
        found = failing("tf.static", static_run(transform(*names)), **PLACED)
        assert words in found and "header.frame_id = 'base_link'" in found

    def test_one_that_is_sent_on_tf_instead_is_told(self) -> None:
        moving = on(TF, *((t, [transform("base_link", "laser", stamp_s=t)]) for t in TIMES))
        found = failing("tf.static", run(moving=moving), **PLACED)
        assert "on `/tf` instead of `/tf_static`" in found
        assert "StaticTransformBroadcaster" in found

    def test_where_nothing_is_sent_the_cause_is_that_of_no_messages(self) -> None:
        found = failing("tf.static", run(endpoints=(endpoint(),)), **PLACED)
        assert "'tf_static'" in found


RIGHT = {**ODOM, "rate": "20 Hz", "moving": True}
OF_ODOMETRY = {**ODOM, "source": "/odom"}


class TestBroadcast:
    def test_a_right_broadcaster_passes(self) -> None:
        assert judge("tf.broadcast", broadcasting(), **RIGHT).status is Status.PASSED

    def test_other_transforms_in_between_do_not_count(self) -> None:
        sent = [
            (t + 0.01 * n, [transform("odom", name, stamp_s=t, **pose_of(t))])
            for t in TIMES
            for n, name in enumerate(("base_footprint", "other", "third"))
        ]
        subject = run(moving=on(TF, *sent))
        assert judge("tf.broadcast", subject, **RIGHT).status is Status.PASSED

    @pytest.mark.parametrize("every", [2, 4])
    def test_a_lower_rate_fails(self, every: int) -> None:
        found = failing("tf.broadcast", broadcasting(times_s=TIMES[::every]), **RIGHT)
        assert f"{20 / every:g} Hz" in found

    def test_one_that_never_moves_fails(self) -> None:
        still = broadcasting(lambda _: {})
        assert "always the same" in failing("tf.broadcast", still, **RIGHT)
        assert judge("tf.broadcast", still, **ODOM, rate="20 Hz").status is Status.PASSED

    @pytest.mark.parametrize(
        ("stamp", "words"),
        [
            (lambda _: None, "the stamp is 0"),
            (lambda _: 0.7, "always the same, or of another clock"),
            (lambda t: t - 3600.0, "before the moment of publishing"),
            (lambda t: t + 5.0, "5 s after the moment of publishing"),
        ],
    )
    def test_a_wrong_stamp_is_explained(self, stamp: Any, words: str) -> None:
        assert words in failing("tf.broadcast", broadcasting(stamp=stamp), **RIGHT)

    def test_the_stamp_of_the_message_that_it_is_made_of_is_right(self) -> None:
        heard = message(0.6, {"header": {"stamp": {"sec": 0, "nanosec": 0}}}, topic="/pose")
        old = broadcasting(stamp=lambda _: None)
        subject = replace(old, sent={"/pose": (heard,)}, endpoints=(*old.endpoints, stimulus()))
        assert judge("tf.broadcast", subject, **RIGHT).status is Status.PASSED
        late = broadcasting(stamp=lambda t: t - 0.5)
        assert judge("tf.broadcast", late, **RIGHT).status is Status.PASSED

    def test_the_stamp_of_a_message_that_came_later_is_none_of_its_source(self) -> None:
        old = broadcasting(stamp=lambda _: None)
        stamped = {"header": {"stamp": {"sec": 0, "nanosec": 0}}}
        made = message(TIMES[0] + 0.01, stamped, topic="/at")
        subject = replace(old, messages={**old.messages, "/at": (made,)})
        assert "the stamp is 0" in failing("tf.broadcast", subject, **RIGHT)

    def test_a_best_effort_publisher_fails_as_tf2_gets_nothing_from_it(self) -> None:
        lossy = Qos("best_effort", "volatile", liveliness="automatic")
        subject = broadcasting(endpoints=(endpoint(TF, type=TYPE, qos=lossy),))
        assert "reliability best_effort offered" in failing("tf.broadcast", subject, **RIGHT)


class TestFollows:
    def test_a_stamp_that_is_promised_to_be_that_of_the_message_is_compared(self) -> None:
        promised = {**OF_ODOMETRY, "same_stamp": True}

        def with_stamps(stamp: Callable[[float], float]) -> Recording:
            subject = broadcasting(stamp=stamp)
            odometry = tuple(
                replace(one, value={**one.value, "header": transform(stamp_s=time_s)["header"]})
                for one, time_s in zip(subject.on("/odom"), TIMES, strict=True)
            )
            return replace(subject, messages={**subject.messages, "/odom": odometry})

        same, later = with_stamps(lambda one: one), with_stamps(lambda one: one + 0.004)
        for subject, parameters in ((same, promised), (later, OF_ODOMETRY)):
            assert judge("tf.follows", subject, **parameters).status is Status.PASSED
        found = failing("tf.follows", later, **promised)
        assert "59 of 59 transforms have another stamp than the message" in found
        assert "the first one is 4 ms later" in found and "copy header.stamp" in found
        first = failing("tf.follows", with_stamps(lambda _: TIMES[0]), **promised)
        assert "have another stamp" in first

    def test_one_that_follows_its_source_passes(self) -> None:
        finding = judge("tf.follows", broadcasting(), **OF_ODOMETRY)
        assert finding.status is Status.PASSED, finding

    @pytest.mark.parametrize(
        ("turn", "words"),
        [
            (lambda yaw: -yaw, "the yaw with the wrong sign"),
            (lambda yaw: yaw / 2, "half of the yaw"),
            (lambda _: 0.0, "from message to message"),
        ],
    )
    def test_a_wrong_heading_is_explained(self, turn: Any, words: str) -> None:
        def wrong(time_s: float) -> dict[str, Any]:
            yaw = turn(arc(time_s)[2])
            return {**pose_of(time_s), "turn": facing(yaw)}

        found = failing("tf.follows", broadcasting(wrong), **OF_ODOMETRY)
        assert words in found and "Copy the newest pose" in found

    def test_exchanged_axes_are_explained(self) -> None:
        def wrong(time_s: float) -> dict[str, Any]:
            x, y, _ = arc(time_s)
            return {**pose_of(time_s), "place": (y, x, 0.0)}

        assert "it is `pose.pose.position.y`" in failing(
            "tf.follows", broadcasting(wrong), **OF_ODOMETRY
        )

    def test_an_old_pose_fails(self) -> None:
        late = broadcasting(lambda t: pose_of(max(0.7, t - 0.6)))
        assert "earlier" in failing("tf.follows", late, **OF_ODOMETRY)

    @pytest.mark.parametrize("drift_m", [0.0, 0.3])
    def test_the_true_pose_of_the_robot_is_the_source_by_default(self, drift_m: float) -> None:
        truth = drive(lambda _: (0.2, 0.5), seconds=6.0, rest_s=None)
        sent = [
            (
                (step.time_ns - LAUNCH_NS) / 1e9,
                [
                    transform(
                        place=(step.x_m + drift_m * step.y_m, step.y_m, 0.0),
                        turn=facing(step.yaw_rad),
                        stamp_s=(step.time_ns - LAUNCH_NS) / 1e9,
                    )
                ],
            )
            for step in truth.truth[5::5]
        ]
        subject = replace(truth, messages={TF: on(TF, *sent)})
        finding = judge("tf.follows", subject, **ODOM)
        assert finding.status is (Status.FAILED if drift_m else Status.PASSED), finding

    def test_a_pose_that_stands_still_cannot_be_judged(self) -> None:
        subject = broadcasting()
        still = tuple(replace(one, value=odometry_of(1.0)) for one in subject.on("/odom"))
        subject = replace(subject, messages={**subject.messages, "/odom": still})
        assert judge("tf.follows", subject, **OF_ODOMETRY).status is Status.ERROR


class TestTree:
    FRAMES = (("map", "odom"), ("odom", "base_link"), ("base_link", "laser"))

    @staticmethod
    def of(*edges: tuple[str, str], static: Iterable[tuple[str, str]] = ()) -> Recording:
        moving = on(TF, *((t, [transform(*e, stamp_s=t) for e in edges]) for t in TIMES if edges))
        return run(moving=moving, static=on(TF_STATIC, (0.7, [transform(*e) for e in static])))

    def test_one_tree_passes(self) -> None:
        subject = self.of(*self.FRAMES[:2], static=self.FRAMES[2:])
        for more in ({}, {"root": "map", "frames": ["laser"]}, {"static": ["laser"]}):
            assert judge("tf.tree", subject, **more).status is Status.PASSED

    @pytest.mark.parametrize(
        ("edges", "parameters", "words"),
        [
            ([("map", "odom"), ("base_link", "laser")], {}, "2 trees, with the roots `map` and"),
            ([*FRAMES, ("map", "laser")], {}, "two parents, `base_link` and `map`"),
            ([("a", "b"), ("b", "a")], {}, "a circle"),
            ([("a", "a")], {}, "a circle"),
            ([*FRAMES, ("a", "b"), ("b", "a")], {}, "a circle"),
            ([("/map", "odom")], {}, "a slash in front"),
            (FRAMES, {"root": "odom"}, "the root is `map`"),
            (FRAMES, {"frames": ["camera"]}, "no frame `camera`"),
            (FRAMES, {"static": ["laser"]}, "of the frame `laser` is on `/tf`"),
        ],
    )
    def test_what_is_no_such_tree_fails(self, edges: Any, parameters: Any, words: str) -> None:
        assert words in failing("tf.tree", self.of(*edges), **parameters)

    def test_what_moves_must_not_be_static(self) -> None:
        subject = self.of(static=self.FRAMES)
        found = failing("tf.tree", subject, static=["laser"])
        assert "is on `/tf_static`" in found

    def test_a_program_that_crashed_is_told_first(self) -> None:
        subject = replace(self.of(*self.FRAMES), **CRASH)
        assert "KeyError" in failing("tf.tree", subject, frames=["camera"])
        assert "KeyError" in failing("tf.static", subject, **PLACED)

    def test_where_nothing_is_sent_the_cause_is_that_of_no_messages(self) -> None:
        assert "'tf'" in failing("tf.tree", run(endpoints=(endpoint(),)))


@given(st.tuples(*[st.floats(-7.0, 7.0)] * 3))
def test_rotations_are_those_of_scipy(angles: tuple[float, float, float]) -> None:
    own = Rotation.from_quat(list(transforms.quaternion(*angles).values()))
    assert (own.inv() * Rotation.from_euler("xyz", angles)).magnitude() < 1e-6


def test_a_long_chain_of_frames_is_judged_at_once() -> None:
    edges = [(f"f{n}", f"f{n + 1}") for n in range(20_000)]
    subject = run(static=on(TF_STATIC, (0.7, [transform(*e) for e in edges])))
    assert transforms.roots(list(transforms.sent(subject, (TF_STATIC,)))) == ["f0"]
