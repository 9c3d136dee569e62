"""The models of ``mutants.yaml``: mistakes that checks must notice, and what they must not.

A mutant is the reference with one mistake of a student in it, and names the checks that must
fail for it. A variant is another right solution, in an unusual style, and must keep every
point. An entry says under ``python`` and ``cpp`` what is different in the reference in each
language::

    mutants:
      - id: wrong_topic
        title: The topic is called /cmdvel
        python: {file: bot/bot/node.py, replace: /cmd_vel, with: /cmdvel}
        cpp: {file: bot/src/node.cpp, replace: /cmd_vel, with: /cmdvel}
        loses: [topic]
"""

from __future__ import annotations

from pathlib import PurePosixPath
from typing import Annotated, Literal

from pydantic import AfterValidator, Field, model_validator

from grader.spec.document import Place
from grader.spec.name import Id, TopicName
from grader.spec.quantity import Duration
from grader.spec.source import Model


def _inside(text: str) -> str:
    """A path that stays in the folder it is relative to."""
    path = PurePosixPath(text)
    if path.is_absolute() or ".." in path.parts or not path.parts or str(path) != text:
        raise ValueError(f"{text!r} is not a path in the reference, such as 'package/setup.py'")
    return text


FilePath = Annotated[str, AfterValidator(_inside)]


class _Place(Model):
    """Where texts are replaced."""

    file: FilePath | None = Field(
        None,
        description="Path in the reference, with forward slashes; by default the `file` of all.",
    )
    count: int = Field(1, ge=1, description="How often the text occurs in the file.")


class Edit(_Place):
    """A text to replace in one file of the reference."""

    replace: str = Field(
        min_length=1, description="The text in the file; it occurs exactly `count` times."
    )
    with_: str = Field(alias="with", description="The new text.")


class BagEdit(Model):
    """What is different in a bag of the reference."""

    folder: FilePath = Field(description="Its folder in the reference.")
    without: tuple[TopicName, ...] = Field((), description="Topics that are not in it.")
    rename: dict[TopicName, TopicName] = Field(
        default_factory=dict, description="Topics that have another name in it."
    )
    since: Duration | None = Field(None, description="The recording begins so much later.")
    until: Duration | None = Field(None, description="The recording ends so long after its start.")
    every: dict[TopicName, int] = Field(
        default_factory=dict,
        description="Topic -> n: only each nth of its messages is in it.",
    )
    storage: Literal["mcap", "sqlite3"] = Field("mcap", description="How it is stored.")


class Edits(_Place):
    """What is different from the reference: `edits` first, then `files`, `move` and `bag`."""

    replace: str | None = Field(
        None, min_length=1, description="Where there is one edit only: the text in the file."
    )
    with_: str | None = Field(None, alias="with", description="The new text of that edit.")
    edits: tuple[Edit, ...] = Field((), description="Texts to replace, one after the other.")
    files: dict[FilePath, str | None] = Field(
        default_factory=dict,
        description="Whole files: path -> content; null deletes the file, or the folder.",
    )
    move: dict[FilePath, FilePath] = Field(
        default_factory=dict, description="Files or folders to move: from -> to."
    )

    bag: BagEdit | None = Field(None, description="What is different in a bag.")

    @model_validator(mode="after")
    def _belong_together(self) -> Edits:
        if (self.replace is None) != (self.with_ is None):
            raise ValueError("`replace` and `with` belong together")
        return self

    @property
    def has_edits(self) -> bool:
        """Whether anything is different by it."""
        return bool(self.edits or self.files or self.move or self.replace or self.bag)

    def placed_edits(self) -> dict[Place, Edit]:
        """Its edits by their places in it, each with its file.

        ``{file: a.py, replace: x, with: y}`` is short for a list of one edit.
        """
        placed: dict[Place, Edit] = {}
        if self.replace is not None:
            only = {"count": self.count, "replace": self.replace, "with": self.with_}
            placed[()] = Edit.model_validate(only)
        placed |= {("edits", index): edit for index, edit in enumerate(self.edits)}
        return {
            place: edit.model_copy(update={"file": edit.file or self.file})
            for place, edit in placed.items()
        }


class Change(Edits):
    """What is different from the reference of the file's language, or of each language."""

    id: Id = Field(description="Short name, unique in the file.")
    title: str = Field(description="What is different, in plain words.")
    python: Edits | None = Field(None, description="What is different in the Python reference.")
    cpp: Edits | None = Field(None, description="What is different in the C++ reference.")
    skip_reason: str = Field(
        "", description="Why `rosgrade selftest` skips it; by default it does not."
    )

    def edits_under(self, language: Literal["python", "cpp"]) -> Edits | None:
        """What it says under the key of a language."""
        return self.python if language == "python" else self.cpp


class Mutant(Change):
    """The reference with one mistake in it."""

    loses: tuple[Id, ...] = Field(
        min_length=1,
        description="Checks that must fail. Those that require them are skipped; all others "
        "must pass.",
    )


class Variant(Change):
    """A correct solution in another style; every check must pass."""


class Files(Model):
    """A file of each reference."""

    python: FilePath | None = Field(None, description="Path in the reference in Python.")
    cpp: FilePath | None = Field(None, description="Path in the reference in C++.")


class Losses(Model):
    """What a standard mutant loses in this assignment."""

    loses: tuple[Id, ...] = Field(min_length=1, description="Checks that must fail.")


class MutantFile(Model):
    """The mutants and variants of an assignment: `assignments/<id>/mutants.yaml`.

    `mutants_cpp.yaml` is the same for what there is only for the reference in C++.
    """

    rosgrade: Literal[1] = Field(description="Version of this format.")
    file: Files = Field(default_factory=Files, description="Where edits are that name no file.")
    derived: dict[Id, Literal[False] | Losses] = Field(
        default_factory=dict,
        description="Standard mutants that lose other checks than follow from the contract, or "
        "`false` for one that is left out.",
    )
    mutants: tuple[Mutant, ...] = Field((), description="Mistakes.")
    variants: tuple[Variant, ...] = Field((), description="Correct solutions in another style.")
