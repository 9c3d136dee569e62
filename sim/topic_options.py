"""The YAML options that every topic and every sensor of the simulator has."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from grader.spec.name import topic_name
from grader.spec.quantity import DurationOrZero, Frequency, QuantityOf
from grader.spec.source import Model
from grader.spec.unit import Dimension

TopicName = Annotated[str, AfterValidator(topic_name)]
Rate = Annotated[Frequency, Field(le=100.0)]
LengthOrZero = Annotated[float, QuantityOf(Dimension.LENGTH, minimum=0.0)]


class TopicOptions(Model):
    """A topic with its QoS."""

    topic: TopicName = Field(description="Fully qualified name.")
    reliability: Literal["reliable", "best_effort"] = Field("reliable")
    durability: Literal["volatile", "transient_local"] = Field("volatile")
    depth: int = Field(10, ge=1, le=10_000)


class Timed(Model):
    """When a sensor publishes."""

    rate: Rate = Field(description="Messages per second, at most 100 Hz.")
    starts: DurationOrZero = Field(0.0, description="No message before this time.")
    stops: DurationOrZero | None = Field(None, description="No message from this time on.")
