"""The documentation that is made from the code: ``python -m grader.docs [--check]``.

``docs/assignment-yaml.md`` comes from the models of the YAML, ``docs/checks.md`` from the
catalogue of checks, ``docs/recording.md`` from the model of a recording. Nothing in them is typed
twice; with ``--check`` a stale file is an error.
"""

from __future__ import annotations

import argparse
import inspect
import re
import sys
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from types import FunctionType
from typing import Any

from pydantic import BaseModel

from grader import resources
from grader.assignment import limits, model, mutant
from grader.assignment.own_check import FOLDER, lesson_checks
from grader.assignment.stimuli.stimulus import stimulus_models
from grader.checks import finding
from grader.checks.catalogue import CATALOGUE
from grader.checks.check import Check, Subject
from grader.checks.tolerance import TimeTolerance
from grader.diagnosis.explanation import explanations
from grader.recording import event, interaction, simulated
from grader.recording import model as recording
from grader.spec.unit import UNITS, Dimension, format_duration
from sim import description, world_model
from sim.motion import Pose

_MADE = "<!-- Made by `python -m grader.docs` from the code: change it there. -->"

# Heading of a section -> the model that it describes, in the order of reading.
_ASSIGNMENT_SECTIONS: dict[str, type[BaseModel]] = {
    "The whole file": model.Assignment,
    "packages": model.Package,
    "scenarios": model.Scenario,
    "launch": model.Launch,
    "record": model.RecordedTopic,
    **{f"stimuli: {one.heading or one.key}": one for one in stimulus_models()},
    "until": model.Until,
    "limits": limits.LimitOptions,
    "build_limits": limits.BuildLimitOptions,
    "robot": description.RobotOptions,
    "robot: drives": description.Drive,
    "lidar": description.LidarOptions,
    "odometry": description.OdometryOptions,
    "odometry: drift": description.DriftOptions,
    "odometry: covariance": description.CovarianceOptions,
    "topics": description.Topics,
    "topics: command": description.CommandTopic,
    "topics: odometry": description.OdometryTopic,
    "topics: scan": description.ScanTopic,
    "topics: clock": description.ClockTopic,
    "topics: tf": description.TransformTopic,
    "checks": model.CheckSpec,
}
_MUTANT_SECTIONS: dict[str, type[BaseModel]] = {
    "The whole of mutants.yaml": mutant.MutantFile,
    "mutants": mutant.Mutant,
    "variants": mutant.Variant,
    "edits": mutant.Edit,
}
_WORLD_SECTIONS: dict[str, type[BaseModel]] = {
    "The whole of a world": world_model.WorldModel,
    "boxes": world_model.BoxModel,
    "circles": world_model.CircleModel,
    "polygons": world_model.PolygonModel,
    "moving": world_model.MovingModel,
    "moving: circle": world_model.RoundModel,
    "moving: box": world_model.CornerModel,
    "moving: path": world_model.WaypointModel,
}
_HEADINGS = {
    one.__name__: heading
    for sections in (_ASSIGNMENT_SECTIONS, _MUTANT_SECTIONS, _WORLD_SECTIONS)
    for heading, one in sections.items()
}
_OWN_CHECKS = """\
`python: checks.py:drives_straight` names a function in a file beside assignment.yaml:

```python
from grader.spec.quantity import Angle
from grader.checks.finding import Finding
from grader.recording.model import Recording


def drives_straight(recording: Recording, topic: str, tolerance: Angle = 0.01) -> Finding:
    \"""The robot drives straight ahead.\"""
    turns = [abs(message.value["angular"]["z"]) for message in recording.on(topic)]
    if max(turns, default=0.0) <= tolerance:
        return Finding.passed("no turn", "none")
    return Finding.failed("no turn", f"turns with {max(turns):g} rad/s", "Leave angular.z at 0.")
```

Its first argument is [the recording](recording.md); the others are the keys of `with`, validated
by their annotations. The first line of its docstring is its title. It must be a pure function: it
is called again when a recording is judged again. An exception in it costs no student a point; the
submission counts as not graded. The file runs in the grader's own process, so its author must be
trusted."""
_EXAMPLES = {
    Dimension.TIME: "300 ms",
    Dimension.FREQUENCY: "10 Hz",
    Dimension.LENGTH: "0.2 m",
    Dimension.ANGLE: "5 deg",
    Dimension.SPEED: "0.22 m/s",
    Dimension.ANGULAR_SPEED: "90 deg/s",
    Dimension.ACCELERATION: "0.5 m/s^2",
    Dimension.ANGULAR_ACCELERATION: "1 rad/s^2",
    Dimension.RATIO: "5 %",
    Dimension.SIZE: "64 MiB",
}
_RECORDED = (
    recording.Recording,
    recording.Message,
    recording.Node,
    recording.Endpoint,
    recording.Qos,
    recording.Process,
    recording.LogLine,
    recording.Call,
    interaction.Goal,
    interaction.Feedback,
    interaction.Service,
    recording.Join,
    event.Intervention,
    simulated.Truth,
    simulated.Incident,
    simulated.Scene,
    recording.Declaration,
    event.Disturbance,
)
_FOUND = (finding.Finding, finding.Evidence, finding.Moment, finding.Plot, finding.Table)
_READABLE = (FunctionType, property, cached_property)
_TYPES = {
    "string": "text",
    "number": "number",
    "integer": "whole number",
    "boolean": "`true` or `false`",
    "object": "keys and values",
}


def assignment_markdown() -> str:
    """The description of ``assignment.yaml`` and ``mutants.yaml``."""
    example = resources.assignments() / "timed_publisher" / "assignment.yaml"
    world = resources.assignments() / "bot_controller" / "worlds" / "crossing.yaml"
    parts = [
        "# assignment.yaml",
        _MADE,
        "An assignment is a folder `assignments/<id>/` with `assignment.yaml`, a handout "
        "`README.md` and `mutants.yaml`. `rosgrade validate` checks the files and names the "
        "line of every mistake; `rosgrade schema` prints a JSON Schema for editors.",
        "Scalars are those of YAML 1.2: `on`, `yes` and `12:30` are text, `1e-3` is a number.",
        *(_model_section(*item) for item in _ASSIGNMENT_SECTIONS.items()),
        "## Quantities",
        "A quantity is a number with its unit; zero may stand without, and so may a ratio "
        "below one (`0.05` is `5 %`).",
        _table(("quantity", "units", "example"), _quantity_rows()),
        "## Own checks",
        _OWN_CHECKS,
        "## Example",
        f"```yaml\n{example.read_text(encoding='utf-8').strip()}\n```",
        "# mutants.yaml",
        *(_model_section(*item) for item in _MUTANT_SECTIONS.items()),
        "# World files",
        "A world is a file of its own. `rosgrade sim` takes it too, and any key may be left out: "
        "`start: [0, 0, 0 deg]` alone is a world without obstacles. In a list, a length without a "
        "unit is in metres; an angle needs its unit.",
        *(_model_section(*item) for item in _WORLD_SECTIONS.items()),
        "For example:",
        f"```yaml\n{world.read_text(encoding='utf-8').strip()}\n```",
    ]
    return "\n\n".join(parts) + "\n"


def checks_markdown(catalogue: Mapping[str, Check] = CATALOGUE) -> str:
    """The catalogue of checks."""
    rows = [
        (f"[`{check.name}`]({_anchor(check.name)})", check.title) for check in catalogue.values()
    ]
    parts = [
        "# Checks",
        _MADE,
        "What `uses` in an [assignment.yaml](assignment-yaml.md) may name, with the keys of "
        "`with`. A check judges either what was handed in, before it runs, or the recording "
        "of a run. Why a check failed is told with what it found: "
        "[what rosgrade can explain](explanations.md).",
        _table(("check", "what it asks for"), rows),
        *(check_markdown(check) for check in catalogue.values()),
        *_lessons_markdown(),
    ]
    return "\n\n".join(parts) + "\n"


def _lessons_markdown() -> Iterator[str]:
    """The checks that lie beside the YAML of rosgrade's own assignments."""
    yield "# Checks of single lessons"
    yield (
        "These lie in the folder `checks/` of one assignment, which alone can use them. An "
        "assignment of yours can have [checks of its own](own-checks.md) in the same way, or "
        "start with a copy of the folder."
    )
    for folder in sorted(resources.assignments().glob(f"*/{FOLDER}")):
        for check in lesson_checks(folder.parent).values():
            text = check_markdown(check)
            yield text.replace("\n\n", f"\n\nOnly in `{folder.parent.name}`. ", 1)


def explanations_markdown() -> str:
    """What rosgrade can tell a student, by symptom."""
    parts = [
        "# What rosgrade can explain",
        _MADE,
        "A check says that something is missing or wrong. Then rosgrade looks for the cause in "
        "what it recorded. Each list below belongs to one symptom, the deepest causes first: the "
        "first one that applies is told, with the place in the code where it can be known, and "
        "with what to try next. Where the fault is not the student's, the check ends as an error, "
        "and no point is lost.",
    ]
    for symptom, entries in sorted(explanations().items(), key=lambda item: _sentence(item[0])):
        parts.append(f"## {_sentence(symptom)}")
        parts.append("\n".join(f"- {entry.sentence}" for entry in entries))
    return "\n\n".join(parts) + "\n"


def _sentence(symptom: type[Any]) -> str:
    """The first line of a symptom's docstring, as a heading."""
    return (inspect.getdoc(symptom) or symptom.__name__).partition("\n")[0].rstrip(".")


def check_markdown(check: Check) -> str:
    """One check: what it asks for, what it explains, its parameters."""
    parts = [f"## {check.name}", _outside_code(check.documentation)]
    if check.subject is Subject.SUBMISSION:
        parts.append("A check of what was handed in: it has no `scenarios`.")
    if check.parameters.model_fields:
        parts.append(_fields_table(check.parameters))
    if check.parameters.needs:
        parts.append(f"Needs {'; '.join(map(str, check.parameters.needs))}.")
    return "\n\n".join(parts)


def recording_markdown() -> str:
    """What an own check can look at, and what it returns."""
    parts = [
        "# The recording",
        _MADE,
        "An [own check](assignment-yaml.md#own-checks) gets the recording of one run. These are "
        "its parts, as Python objects that cannot be changed. Names that end in `_ns` are times in "
        "nanoseconds since 1970 on the clock of the machine that ran the scenario; "
        "`recording.since_launch_s(time_ns)` makes seconds of them.",
        *map(_class_section, _RECORDED),
        "# The finding",
        "A check returns `Finding.passed(expected, observed)` or `Finding.failed(expected, "
        "observed, hint)`, both with an `evidence` if there is something to show.",
        *map(_class_section, _FOUND),
    ]
    return "\n\n".join(parts) + "\n"


def _class_section(one: type) -> str:
    documentation = re.sub(r":\w+:`", "`", inspect.getdoc(one) or "")
    text, _, attributes = documentation.partition("\nAttributes:\n")
    entries = re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", attributes, re.MULTILINE)
    rows = [(f"`{name}`", " ".join(words.split())) for name, words in entries]
    for name, member in vars(one).items():
        told = inspect.getdoc(member)
        if name.startswith("_") or not told or not isinstance(member, _READABLE):
            continue
        call = f"{name}{_arguments(member)}" if inspect.isfunction(member) else name
        rows.append((f"`{call}`", told.partition("\n")[0]))
    table = [_outside_code(_table(("name", "meaning"), rows).replace("``", "`"))] if rows else []
    told = _outside_code(text.strip().replace("``", "`"))
    return "\n\n".join([f"## {one.__name__}", told, *table])


def _arguments(function: Any) -> str:
    names = [name for name in inspect.signature(function).parameters if name != "self"]
    return f"({', '.join(names)})"


def _model_section(heading: str, one: type[BaseModel]) -> str:
    return f"## {heading}\n\n{inspect.getdoc(one)}\n\n{_fields_table(one)}"


def _anchor(heading: str) -> str:
    """The link to a heading, as Markdown renderers make it."""
    return "#" + re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")


def _outside_code(text: str) -> str:
    """Escape what HTML would take for tags, but not in `code`."""
    parts = text.split("`")
    parts[::2] = [part.replace("<", "&lt;") for part in parts[::2]]
    return "`".join(parts)


def _fields_table(one: type[BaseModel]) -> str:
    schema = one.model_json_schema(by_alias=True)
    definitions = schema.get("$defs", {})
    # A model that holds itself is among its own definitions.
    schema = definitions.get(str(schema.get("$ref", "")).rpartition("/")[2], schema)
    required = schema.get("required", [])
    fields = {field.alias or name: field for name, field in one.model_fields.items()}
    rows = []
    for key, found in schema.get("properties", {}).items():
        default = "required" if key in required else _default(found, fields[key].default)
        meaning = _outside_code(str(found.get("description", "")).replace("\n", " "))
        rows.append((f"`{key}`", _value(found, definitions), default, meaning))
    return _table(("key", "value", "default", "meaning"), rows)


def _value(schema: Mapping[str, Any], definitions: Mapping[str, Any]) -> str:
    """What may be written, in words."""
    if "x-words" in schema:
        return str(schema["x-words"])
    if "x-dimension" in schema:
        dimension = Dimension(schema["x-dimension"])
        return f"{dimension.value}, such as `{_EXAMPLES[dimension]}`"
    if "$ref" in schema:
        name = str(schema["$ref"]).rpartition("/")[2]
        heading = _HEADINGS.get(name)
        return f"[{heading}]({_anchor(heading)})" if heading else _value(definitions[name], {})
    for key in ("anyOf", "oneOf"):
        if key in schema:
            forms = [form for form in schema[key] if form.get("type") != "null"]
            return " or ".join(dict.fromkeys(_value(form, definitions) for form in forms))
    if "enum" in schema or "const" in schema:
        allowed = schema.get("enum", [schema.get("const")])
        return " or ".join(f"`{value}`" for value in allowed)
    kind = schema.get("type")
    if kind == "array":
        return f"list of {_value(schema.get('items', {}), definitions)}"
    inner = schema.get("additionalProperties")
    if kind == "object" and isinstance(inner, dict):
        nullable = " or `null`" if {"type": "null"} in inner.get("anyOf", ()) else ""
        return f"keys, each with {_value(inner, definitions)}{nullable}"
    return _TYPES.get(str(kind), "anything") + _bounds(schema)


def _bounds(schema: Mapping[str, Any]) -> str:
    words = {
        "minimum": "at least",
        "exclusiveMinimum": "more than",
        "maximum": "at most",
        "exclusiveMaximum": "less than",
    }
    found = [f"{word} {schema[key]:g}" for key, word in words.items() if key in schema]
    return f", {' and '.join(found)}" if found else ""


def _default(schema: Mapping[str, Any], value: Any) -> str:
    """A default as an author would write it.

    Args:
        value: The default itself.
    """
    default = schema.get("default")
    if default in (None, "", [], {}):
        return ""
    if isinstance(value, Pose):
        return f"`[{value.x_m:g}, {value.y_m:g}, {value.yaw_rad:g} rad]`"
    if isinstance(value, TimeTolerance):
        return f"`{value}`"
    dimensions = [form.get("x-dimension") for form in (schema, *schema.get("anyOf", ()))]
    found = next(filter(None, dimensions), None)
    if found is not None:
        return f"`{_quantity(default, Dimension(found))}`"
    if isinstance(default, bool):
        return f"`{str(default).lower()}`"
    return f"`{default}`"


def _quantity(value: float, dimension: Dimension) -> str:
    """A value in SI units, in the unit that makes it shortest."""
    if dimension is Dimension.TIME:
        return format_duration(value)
    forms = [f"{value / factor:g} {unit}" for unit, factor in UNITS[dimension].items()]
    return min(forms, key=len)


def _quantity_rows() -> Iterator[tuple[str, ...]]:
    for dimension, units in UNITS.items():
        listed = ", ".join(f"`{unit}`" for unit in units)
        yield dimension.value, listed, f"`{_EXAMPLES[dimension]}`"


def _table(header: tuple[str, ...], rows: Any) -> str:
    lines = [header, ("---",) * len(header), *rows]
    cells = [[str(cell).replace("|", "\\|") for cell in line] for line in lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in cells)


def documents() -> dict[str, str]:
    """Every generated file of ``docs/``, by name."""
    return {
        "assignment-yaml.md": assignment_markdown(),
        "checks.md": checks_markdown(),
        "explanations.md": explanations_markdown(),
        "recording.md": recording_markdown(),
    }


def stale(folder: Path) -> list[str]:
    """Names of generated files in a folder that are missing or not up to date."""
    return [
        name
        for name, text in documents().items()
        if not (folder / name).is_file() or (folder / name).read_text(encoding="utf-8") != text
    ]


def main(arguments: list[str] | None = None) -> int:
    """Write the files, or with ``--check`` only compare them."""
    parser = argparse.ArgumentParser(prog="python -m grader.docs", description=__doc__)
    parser.add_argument("--check", action="store_true", help="only compare; 1 if one is stale")
    parser.add_argument("--folder", type=Path, default=resources.root() / "docs")
    options = parser.parse_args(arguments)
    old = stale(options.folder)
    if options.check:
        for name in old:
            print(f"{options.folder / name} is stale: run python -m grader.docs", file=sys.stderr)
        return 1 if old else 0
    options.folder.mkdir(exist_ok=True)
    for name in old:
        (options.folder / name).write_text(documents()[name], encoding="utf-8")
        print(options.folder / name)
    return 0


if __name__ == "__main__":
    sys.exit(main())
