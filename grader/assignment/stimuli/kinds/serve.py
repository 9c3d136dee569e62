"""The stimuli that offer a service or an action to clients of the student."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any, ClassVar, Literal

from pydantic import Field

from grader.assignment.stimuli.message import StimulusError, part_of, read_message
from grader.assignment.stimuli.stimulus_model import (
    Models,
    Preparation,
    ScenarioOfStimuli,
    StimulusModel,
    kind,
)
from grader.checks.need import Act
from grader.spec.document import Place
from grader.spec.name import InterfaceName, TopicName
from grader.spec.nearest_name import nearest_or_all
from grader.spec.quantity import Duration, DurationOrZero, Speed
from grader.spec.source import Model

_POSITIONS = ("x", "position.x", "pose.position.x", "pose.pose.position.x")
"""Where messages of poses have their position."""
_Lasting = DurationOrZero | Literal["forever"]


class Answer(Model):
    """What an answer to a request, and one to a goal, have in common."""

    parts: ClassVar[dict[str, int]] = {"when": 0}
    """Keys with fields of the interface -> which part of its definition has them."""

    when: dict[str, Any] = Field(
        default_factory=dict,
        description="Fields of the request or goal that this answer is for; by default any.",
    )
    delay: _Lasting = Field(
        0.0, description="Time until it is given; `forever` for a request that gets no answer."
    )

    @property
    def delay_s(self) -> float:
        """The same in seconds, perhaps infinite."""
        return _seconds(self.delay)


class ServiceAnswer(Answer):
    """One answer of a served service."""

    parts: ClassVar[dict[str, int]] = {"when": 0, "response": 1}

    response: dict[str, Any] = Field(
        default_factory=dict, description="The fields of the response; an omitted field is zero."
    )


class DriveTo(Model):
    """How a served action drives the simulated robot."""

    to: str = Field(
        description="Field of the goal with the pose, such as `pose`: a Pose, a PoseStamped, a "
        "Point or a Pose2D, in the frame of the world. A quaternion of zeros: any heading."
    )
    distance: str | None = Field(
        None, description="Field of the feedback that gets the distance that remains."
    )
    speed: Speed = Field(0.2, description="How fast it drives.")
    robot: str = Field("", description="Which of the scenario's `robots`, if it has several.")


class GoalAnswer(Answer):
    """One answer of a served action: what becomes of a goal."""

    parts: ClassVar[dict[str, int]] = {"when": 0, "result": 1, "feedback": 2}

    takes: _Lasting = Field(
        0.0,
        description="Time from the acceptance to the end of the goal, by default as long as its "
        "feedback lasts; `forever` if only a cancel request ends it. With `drive` the longest "
        "time: the goal is aborted then.",
    )
    feedback: tuple[dict[str, Any], ...] = Field(
        (), description="Feedback messages, one after another; the last one is repeated."
    )
    every: Duration = Field(0.1, description="Time between two feedback messages.")
    status: Literal["succeeded", "aborted", "rejected"] = Field(
        "succeeded", description="How the goal ends; one that is `rejected` is never accepted."
    )
    result: dict[str, Any] = Field(
        default_factory=dict, description="The fields of the result, whatever the status."
    )
    cancel: Literal["accept", "reject"] = Field(
        "accept", description="Answer to a cancel request; an accepted one ends the goal at once."
    )
    drive: DriveTo | None = Field(
        None, description="Drive the simulated robot to the pose of the goal, which then succeeds."
    )

    @property
    def takes_s(self) -> float:
        """How long it takes, perhaps infinite; by default as long as the feedback lasts."""
        if "takes" in self.model_fields_set:
            return _seconds(self.takes)
        return len(self.feedback) * self.every


def _fits(read: Callable[..., Any], path: str) -> bool:
    try:
        read({path: 0.0}, 0)
    except StimulusError:
        return False
    return True


def _seconds(lasting: float | Literal["forever"]) -> float:
    return math.inf if lasting == "forever" else lasting


class Serve(StimulusModel):
    """Part of both: a server with its name, its type and its answers."""

    key = "serve"
    provides = (Act.SERVE,)
    folder: ClassVar[str]
    usual: ClassVar[Answer]
    """The answer where none is given."""

    serve: TopicName = Field(description="Fully qualified name.")
    after: DurationOrZero = Field(
        0.0,
        description="When the server appears, counted from the first match; by default before the "
        "launch. A client that does not wait for it loses its request.",
    )
    type: InterfaceName
    answers: tuple[Any, ...] = ()

    @classmethod
    def accepts(cls, value: Mapping[str, Any]) -> bool:
        """Whether its type is a service; the first kind, and else an action."""
        return cls.folder == "action" or "/srv/" in str(value.get("type"))

    def prepared(self, preparation: Preparation) -> Serve:
        """The same with its answers read, or the usual one."""
        if f"/{self.folder}/" not in self.type:
            raise StimulusError("expected an interface in srv or action", ("type",))
        answers = enumerate(self.answers or (self.usual,))
        read = tuple(self._read(one, number, preparation) for number, one in answers)
        return self.model_copy(update={"answers": read})

    def _read(self, answer: Answer, number: int, preparation: Preparation) -> Answer:
        def read(value: Mapping[str, Any], part: int, *place: str | int) -> dict[str, Any]:
            find = part_of(preparation.find, self.type, part)
            inside = ("answers", number, *place)
            return read_message(value, self.type, find, preparation.drawn, inside)

        if isinstance(answer, GoalAnswer) and answer.drive is not None:
            to = answer.drive.to
            read({to: {}}, 0, "drive", "to")
            if not any(_fits(read, f"{to}.{x}") for x in _POSITIONS):
                place: Place = ("answers", number, "drive", "to")
                raise StimulusError(f"the field {to!r} of the goal has no position", place)
            if answer.drive.distance is not None:
                read({answer.drive.distance: 0.0}, 2, "drive", "distance")
        fields: dict[str, Any] = {}
        for key, part in answer.parts.items():
            value = getattr(answer, key)
            if isinstance(value, tuple):
                fields[key] = tuple(read(one, part, key, index) for index, one in enumerate(value))
            else:
                fields[key] = read(value, part, key)
        return answer.model_copy(update=fields)

    def mistakes(
        self, preparation: Preparation, scenario: ScenarioOfStimuli
    ) -> Iterator[tuple[Place, str]]:
        """It stands twice, or drives a robot that is not there, or its answers do not fit."""
        servers = [one for one in scenario.stimuli if isinstance(one, Serve)]
        if next(server for server in servers if server.serve == self.serve) is not self:
            yield ("serve",), f"{self.serve!r} stands twice: give one server several 'answers'"
        for number, answer in enumerate(self.answers):
            drive = getattr(answer, "drive", None)
            if drive is not None and drive.robot not in scenario.simulated_robots:
                text = "there is a simulated robot only in a 'world', which is missing"
                if scenario.simulated_robots:
                    text = f"there is no robot {drive.robot!r}"
                    text += nearest_or_all(drive.robot, scenario.simulated_robots, "The robots are")
                yield ("answers", number, "drive"), text
        yield from super().mistakes(preparation, scenario)


@kind
class ServeService(Serve):
    """Offer a service that the student's node calls.

    Each answer of the list is given once, in order, to a request that fits its `when`. The last
    answer that fits is repeated. If no answer fits, the request gets a response of zeros. Values
    may use `$name` of `random` and quantities such as `30 deg`. What was asked is in the
    recording's `asked`. The stimulus is `done` 1 s after every answer was given.
    """

    heading = "serve a service"
    nested_models: ClassVar[Models] = {"answers of a service": ServiceAnswer}
    folder = "srv"
    usual = ServiceAnswer()

    type: InterfaceName = Field(description="Interface, such as std_srvs/srv/SetBool.")
    answers: tuple[ServiceAnswer, ...] = Field(
        (), description="What it answers, one after another; by default zeros."
    )


@kind
class ServeAction(Serve):
    """Offer an action that the student's node sends goals to.

    Answers are chosen as in `serve` for a service. If no answer fits a goal, it is rejected. Goals
    and cancel requests are in the recording's `asked`. The stimulus is `done` 1 s after every
    answer was given and its goal has ended.
    """

    heading = "serve an action"
    nested_models: ClassVar[Models] = {
        "answers of an action": GoalAnswer,
        "answers of an action: drive": DriveTo,
    }
    folder = "action"
    usual = GoalAnswer()

    type: InterfaceName = Field(
        description="Interface, such as example_interfaces/action/Fibonacci."
    )
    answers: tuple[GoalAnswer, ...] = Field(
        (), description="What becomes of goals, one after another; by default they succeed at once."
    )
