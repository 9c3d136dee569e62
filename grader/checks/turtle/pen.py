"""The check of the pen of a turtle."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, WithJsonSchema, model_validator

from grader.checks.check import Subject, check
from grader.checks.turtle.turtle_check import TurtleParameters
from grader.diagnosis.explanation import mistaken
from grader.findings.finding import Finding, evidence_at
from grader.findings.words import code, counted, metres, percent
from grader.measure.turtle.drawing import Line
from grader.recording.model import Recording
from grader.spec.quantity import Ratio

Shade = Annotated[int, Field(ge=0, le=255)]
Colour = Annotated[
    tuple[Shade, Shade, Shade],
    WithJsonSchema(
        {
            "type": "array",
            "items": {"type": "integer", "minimum": 0, "maximum": 255},
            "minItems": 3,
            "maxItems": 3,
            "x-words": "`[red, green, blue]`",
        }
    ),
]


class Pen(TurtleParameters):
    """Parameters of turtle.pen."""

    colour: Colour | None = Field(
        None, description="Red, green and blue, each from 0 to 255; by default any."
    )
    width: int | None = Field(None, ge=1, le=255, description="Width in pixels; by default any.")
    share: Ratio = Field(
        0.95, description="Share of what it draws that must be drawn with this pen."
    )

    @model_validator(mode="after")
    def _something(self) -> Pen:
        if self.colour is None and self.width is None:
            raise ValueError("give a 'colour', a 'width', or both")
        return self

    def _asked(self) -> str:
        return f"draws with {_words(self.colour, self.width)}"

    def is_right(self, line: Line) -> bool:
        """Whether a line is drawn with it."""
        return self.colour in (None, line.colour) and self.width in (None, line.width)


def _words(colour: tuple[int, int, int] | None, width: int | None) -> str:
    parts = []
    if colour is not None:
        parts.append(f"the colour {list(colour)}")
    if width is not None:
        parts.append(f"{counted(width, 'pixel')} of width")
    return " and ".join(parts)


@check("turtle.pen", Subject.RECORDING, Pen)
def pen(recording: Recording, parameters: Pen) -> Finding:
    """A turtle draws with the pen.

    Judged by the length of its lines on the canvas at the end.
    """
    lines = parameters.lines(recording)
    whole_m = sum(line.length_m for line in lines)
    wrong = [line for line in lines if not parameters.is_right(line)]
    right = 1.0 - sum(line.length_m for line in wrong) / whole_m
    shown = evidence_at(recording, "the first line", lines[0].times_ns[0])
    seen = f"{percent(round(right, 2))} of {metres(whole_m)} are so"
    if right >= parameters.share:
        return Finding.as_asked(seen, shown)
    longest = max(wrong, key=lambda line: line.length_m)
    seen += f"; {metres(longest.length_m)} with {_words(longest.colour, longest.width)}"
    shown = evidence_at(recording, "a line of another pen began", longest.times_ns[0])
    return mistaken("turtle_pen", seen, shown, service=code(f"/{parameters.turtle}/set_pen"))
