"""The bag of a real robot that a scenario reads, in place of a run."""

from __future__ import annotations

from pydantic import Field, model_validator

from grader.spec.name import TopicName
from grader.spec.source import Model


class BagOptions(Model):
    """A recording that students hand in: the folder that `ros2 bag record` writes.

    Its messages are judged like those of a run, and its odometry is the motion of the robot.
    """

    name: str | None = Field(
        None,
        min_length=1,
        description="Name of its folder, in which `*` and `?` stand for anything, such as "
        "`square*`; by default the only bag that is handed in.",
    )
    rename: dict[TopicName, TopicName] = Field(
        default_factory=dict,
        description="What the robot calls its topics, where that is not what the assignment calls "
        "them: `{/robot1/odom: /odom}`.",
    )

    @model_validator(mode="after")
    def _one_each(self) -> BagOptions:
        if len({*self.rename.values()}) < len(self.rename):
            raise ValueError("'rename' gives two topics the same name")
        return self
