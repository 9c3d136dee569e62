"""Turtles on real topics, services and actions, in a domain of their own."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

pytest.importorskip("rclpy")

import rclpy
from geometry_msgs.msg import Twist
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

from grader.machine import ros
from grader.machine.resources import cache_folder
from grader.run.cell.domain import lock_domain
from grader.run.cell.main import add_type_support
from grader.submission.underlay.store import UnderlayStore
from sim.pacing import Lateness
from sim.turtles.bounds import CENTRE_M
from sim.turtles.simulation import Act, Event, Step, Turtles
from sim.turtles.turtle import STEP_NS

pytestmark = [
    pytest.mark.ros,
    pytest.mark.compiles,
    # lark, which rclpy's interfaces import, still uses it.
    pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning"),
]

LIMIT_S = 30.0


@pytest.fixture(scope="module", autouse=True)
def interfaces() -> None:
    """The interfaces of turtlesim, built where ROS lacks them."""
    here = ros.find()
    laid = UnderlayStore(cache_folder(), here).completed(here, ["turtlesim"])
    add_type_support(laid.underlays)


class Bench:
    """Turtles on a clock that the test sets, and a student's node beside them."""

    def __init__(self, domain_id: int) -> None:
        from sim.turtles.node import RosTurtles, make_node

        self.domain_id, self.now_ns = domain_id, 0
        self.contexts: list[Context] = []
        self.node: Any = make_node(self.make_context())
        self.steps: list[Step] = []
        self.late: list[Lateness] = []
        self.answered: list[str] = []
        self.ros = RosTurtles(self.node, Turtles(), self, lambda: self.now_ns)
        self.ros.start()
        context = self.make_context()
        self.student: Any = rclpy.create_node("student", context=context)
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.student)

    def make_context(self) -> Context:
        self.contexts.append(Context())
        rclpy.init(context=self.contexts[-1], domain_id=self.domain_id)
        return self.contexts[-1]

    def on_step(self, step: Step, stamp_ns: int) -> None:
        self.steps.append(step)

    def on_answer(self, request: Any, response: Any) -> None:
        self.answered.append(request.service.srv_name)

    def on_late(self, lateness: Lateness) -> None:
        self.late.append(lateness)

    @property
    def events(self) -> list[Event]:
        return [event for step in self.steps for event in step.events]

    def wait(self, condition: Callable[[], bool], what: str) -> None:
        """Serve the student's node, and let simulated time pass, until something holds."""
        end_s = time.monotonic() + LIMIT_S
        while not condition():
            assert time.monotonic() < end_s, f"no {what} within {LIMIT_S} s"
            self.executor.spin_once(timeout_sec=0.02)
            # What arrived now acts in the next step, whenever that is on the clock of the test.
            self.now_ns += STEP_NS
            self.ros.catch_up()

    def call(self, kind: Any, service: str, **fields: object) -> Any:
        client = self.student.create_client(kind, service)
        self.wait(client.service_is_ready, service)
        future = client.call_async(kind.Request(**fields))
        self.wait(future.done, f"answer of {service}")
        return future.result()

    def close(self) -> None:
        self.executor.shutdown()
        for context in self.contexts:
            context.try_shutdown()


@pytest.fixture
def bench(monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.delenv("ROS_STATIC_PEERS", raising=False)
    with lock_domain() as lock:
        subject = Bench(lock.domain_id)
        yield subject
        subject.close()


def test_a_turtle_obeys_its_topic_and_tells_its_pose(bench: Bench) -> None:
    from turtlesim.msg import Color, Pose

    poses: list[Any] = []
    colours: list[Any] = []
    bench.student.create_subscription(Pose, "/turtle1/pose", poses.append, 10)
    bench.student.create_subscription(Color, "/turtle1/color_sensor", colours.append, 10)
    publisher = bench.student.create_publisher(Twist, "/turtle1/cmd_vel", 10)
    bench.wait(lambda: publisher.get_subscription_count() == 1, "subscription")
    bench.wait(lambda: bool(poses and colours), "pose and colour")
    message = Twist()
    message.linear.x = 1.0
    message.linear.y = 1.0
    publisher.publish(message)
    bench.wait(lambda: poses[-1].x > CENTRE_M + 0.5, "motion")
    assert poses[-1].y == pytest.approx(CENTRE_M)
    assert max(one.linear_velocity for one in poses) == 1.0


def test_services_answer(bench: Bench) -> None:
    from std_srvs.srv import Empty
    from turtlesim.srv import Kill, SetPen, Spawn, TeleportAbsolute, TeleportRelative

    assert bench.call(Spawn, "/spawn", x=2.0, y=3.0, theta=0.0, name="bob").name == "bob"
    assert bench.call(Spawn, "/spawn", name="bob").name == ""
    assert bench.call(Spawn, "/spawn", name="no name").name == ""
    bench.call(SetPen, "/bob/set_pen", r=255, width=5)
    bench.call(TeleportAbsolute, "/bob/teleport_absolute", x=4.0, y=4.0, theta=1.0)
    bench.call(TeleportRelative, "/bob/teleport_relative", linear=1.0, angular=-1.0)
    bench.call(Kill, "/kill", name="bob")
    bench.wait(lambda: "bob" not in bench.steps[-1].turtles, "end of bob")
    bench.call(Empty, "/clear")
    bench.call(Empty, "/reset")
    bench.wait(lambda: Act.RESET in [one.act for one in bench.events], "reset")
    acts = [one.act for one in bench.events if one.turtle == "bob"]
    assert acts == [Act.SPAWNED, Act.PEN, Act.TELEPORTED, Act.TELEPORTED, Act.KILLED]
    pen = bench.student.create_client(SetPen, "/bob/set_pen")
    bench.wait(lambda: not pen.service_is_ready(), "end of its services")
    pen = bench.student.create_client(SetPen, "/turtle1/set_pen")
    bench.wait(pen.service_is_ready, "services of the first turtle")


def test_parameters_are_the_background(bench: Bench) -> None:
    from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
    from rcl_interfaces.srv import GetParameters, SetParameters

    found = bench.call(GetParameters, "/turtlesim/get_parameters", names=["background_b"])
    assert found.values[0].integer_value == 255
    for number, is_taken in ((150, True), (300, False)):
        value = ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=number)
        asked = [Parameter(name="background_r", value=value)]
        answer = bench.call(SetParameters, "/turtlesim/set_parameters", parameters=asked)
        assert answer.results[0].successful is is_taken
    assert bench.ros.background == (150, 86, 255)


def test_the_action_turns_a_turtle(bench: Bench) -> None:
    from turtlesim.action import RotateAbsolute

    told: list[float] = []
    client: Any = ActionClient(bench.student, RotateAbsolute, "/turtle1/rotate_absolute")
    bench.wait(client.server_is_ready, "action")

    def send(theta: float) -> Any:
        sent = client.send_goal_async(
            RotateAbsolute.Goal(theta=theta),
            feedback_callback=lambda one: told.append(one.feedback.remaining),
        )
        bench.wait(sent.done, "acceptance")
        return sent.result()

    result = send(1.5).get_result_async()
    bench.wait(result.done, "result")
    assert result.result().status == 4
    assert result.result().result.delta == pytest.approx(-1.5, abs=0.03)
    assert told[0] > 1.0 and told[-1] < 0.1
    handle = send(-1.5)
    canceled = handle.cancel_goal_async()
    bench.wait(canceled.done, "answer to cancel")
    assert len(canceled.result().goals_canceling) == 1
    result = handle.get_result_async()
    bench.wait(result.done, "result")
    assert result.result().status == 5
    refused = client.send_goal_async(RotateAbsolute.Goal(theta=math.nan))
    bench.wait(refused.done, "refusal")
    assert not refused.result().accepted
