"""The stimulus that joins a topic late."""

from __future__ import annotations

from collections.abc import Iterator

from pydantic import Field

from grader.assignment.stimuli.stimulus_model import (
    Preparation,
    ScenarioOfStimuli,
    StimulusModel,
    kind,
)
from grader.checks.need import Act
from grader.spec.document import Place
from grader.spec.name import Durability, Id, InterfaceName, Reliability, TopicName
from grader.spec.quantity import DurationOrZero


@kind
class Join(StimulusModel):
    """Join late: another subscription of the probe, created in the middle of the run.

    Its messages are recorded under its own name, separate from the messages of `record`. If
    `record` does not have the topic, this is the first subscription to it.
    """

    key = "join"
    provides = (Act.JOIN,)

    join: TopicName = Field(description="Topic to subscribe to.")
    type: InterfaceName = Field(description="Interface, such as std_msgs/msg/Int64.")
    name: Id = Field(description="Name of what it records, for the checks.")
    after: DurationOrZero = Field(description="When, counted from the first match.")
    reliability: Reliability = Field("reliable", description="Requested reliability.")
    durability: Durability = Field("volatile", description="Requested durability.")
    depth: int = Field(100, ge=1, le=10_000, description="Queue depth of the subscription.")

    @property
    def subject(self) -> str:
        """Its own name: several may be on one topic."""
        return self.name

    def mistakes(
        self, preparation: Preparation, scenario: ScenarioOfStimuli
    ) -> Iterator[tuple[Place, str]]:
        """Its name is used already, or the probe itself publishes on its topic."""
        joins = [one for one in scenario.stimuli if isinstance(one, Join)]
        if next(join for join in joins if join.name == self.name) is not self:
            yield ("name",), f"the name {self.name!r} is used twice"
        sent = [one.exchanged for one in scenario.stimuli if Act.PUBLISH in one.provides]
        if self.exchanged in sent:
            text = f"the probe publishes on {self.join!r} itself: a late joiner would receive that"
            yield ("join",), text
