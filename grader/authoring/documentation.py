"""The documentation that is made from the code, page by page.

``docs/assignment-yaml.md`` comes from the models of the YAML, ``docs/checks.md`` and a page for
each family from the catalogue of checks, ``docs/recording.md`` and ``docs/finding.md`` from what a
check gets and returns. Nothing in them is typed twice.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from functools import cached_property
from importlib import import_module
from types import FunctionType
from typing import Any

from pydantic import BaseModel

from grader.assignment import bag, limits, model, mutant, true_motion, variable
from grader.assignment.contract import model as contract
from grader.assignment.lesson_checks import FOLDER, lesson_checks
from grader.assignment.stimuli.stimulus import stimulus_models
from grader.authoring.starter import rendered
from grader.checks import window
from grader.checks.catalogue import CATALOGUE, families
from grader.checks.check import Check
from grader.checks.tolerance import TimeTolerance
from grader.diagnosis.explanation import explanations, mistakes
from grader.findings import finding
from grader.machine import resources
from grader.recording import interaction, simulated
from grader.recording import model as recording
from grader.recording.mcap_writer import FACTS
from grader.report.concepts import concepts
from grader.spec.unit import UNITS, Dimension, format_duration
from sim import camera_options, description, sensor_options, world_model
from sim.motion import Pose

_MADE = "<!-- Made by `python -m grader.dev.docs` from the code: change it there. -->"

# Page -> heading of a section -> the model that it describes, in the order of reading.
_SECTIONS: dict[str, dict[str, type[BaseModel]]] = {
    "assignment-yaml": {
        "The whole file": model.Assignment,
        "variables": variable.Variable,
        "variables: where": variable.Role,
        "packages": model.Package,
        "scenarios": model.Scenario,
        "launch": model.Launch,
        "record": model.RecordedTopic,
        "until": model.Until,
        "limits": limits.LimitOptions,
        "build_limits": limits.BuildLimitOptions,
        "checks": model.CheckSpec,
        "checks: after, before, while": window.Phase,
        "manual": model.ManualItem,
        "manual: levels": model.Level,
    },
    "contract": {
        "The whole contract": contract.Contract,
        "packages": contract.ContractPackage,
        "executables": contract.Program,
        "publishes": contract.Publication,
        "subscribes": contract.Subscription,
        "serves, actions, calls, sends_goals": contract.Server,
        "parameters": contract.Declared,
        "interfaces": contract.Interface,
    },
    "stimuli": {
        heading: described
        for stimulus in stimulus_models()
        for heading, described in {
            stimulus.heading or stimulus.key: stimulus,
            **stimulus.nested_models,
        }.items()
    },
    "robot": {
        "robot": description.RobotOptions,
        "robot: drives": description.Drive,
        "lidar": description.LidarOptions,
        "odometry": description.OdometryOptions,
        "imu": sensor_options.ImuOptions,
        "imu: noise": sensor_options.ImuNoise,
        "joint_states": sensor_options.JointOptions,
        "battery": sensor_options.BatteryOptions,
        "ranges": sensor_options.RangeOptions,
        "odometry: drift": description.DriftOptions,
        "odometry: covariance": description.CovarianceOptions,
        "camera": camera_options.CameraOptions,
        "camera: objects": camera_options.ObjectsOptions,
        "topics": description.Topics,
        "topics: command": description.CommandTopic,
        "topics: odometry": description.OdometryTopic,
        "topics: scan": description.ScanTopic,
        "topics: clock": description.ClockTopic,
        "topics: tf": description.TransformTopic,
    },
    "other-robots": {
        "bag": bag.BagOptions,
        "simulator": model.AuthorSimulator,
        "simulator: truth": true_motion.TruthTopic,
        "simulator: ready": true_motion.Ready,
    },
    "mutants": {
        "The whole of mutants.yaml": mutant.MutantFile,
        "mutants": mutant.Mutant,
        "variants": mutant.Variant,
        "edits": mutant.Edit,
        "bag": mutant.BagEdit,
    },
    "worlds": {
        "The whole of a world": world_model.WorldModel,
        "boxes": world_model.BoxModel,
        "circles": world_model.CircleModel,
        "polygons": world_model.PolygonModel,
        "lines": world_model.LineModel,
        "moving": world_model.MovingModel,
        "moving: circle": world_model.RoundModel,
        "moving: box": world_model.CornerModel,
        "moving: path": world_model.WaypointModel,
        "turtles": world_model.TurtleModel,
    },
}
_HEADINGS = {
    one.__name__: (f"{page}.md", heading)
    for page, models in _SECTIONS.items()
    for heading, one in models.items()
}
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
# Page -> the classes that an own check works with, in the order of reading.
_CLASSES = {
    "recording.md": (
        *(recording.Recording, recording.Message, *dict.fromkeys(FACTS.values())),
        *(recording.Qos, interaction.Feedback, simulated.Scene),
    ),
    "finding.md": (
        finding.Finding,
        *(finding.Evidence, finding.Moment, finding.Plot, finding.Table),
    ),
}
# A symptom with more explanations, such as an exception, is on a page of its own.
_MOST_ENTRIES = 30
_READABLE = (FunctionType, property, cached_property)
_TYPES = {
    "string": "text",
    "number": "number",
    "integer": "whole number",
    "boolean": "`true` or `false`",
    "object": "keys and values",
}
_BOUNDS = {
    "minimum": "at least",
    "exclusiveMinimum": "more than",
    "maximum": "at most",
    "exclusiveMaximum": "less than",
}


def assignment_markdown() -> dict[str, str]:
    """The description of ``assignment.yaml``, its parts, ``mutants.yaml`` and worlds, by page."""
    quantities = [
        (dimension.value, ", ".join(f"`{unit}`" for unit in units), f"`{_EXAMPLES[dimension]}`")
        for dimension, units in UNITS.items()
    ]
    folder = resources.assignments()
    example = folder / "timed_publisher" / "assignment.yaml"
    world = folder / "bot_controller" / "worlds" / "crossing.yaml"
    return {
        f"{page}.md": _rendered(
            f"{page}.md",
            sections=sections,
            documentation=inspect.getdoc,
            fields_table=_fields_table,
            quantities=quantities,
            example=example.read_text(encoding="utf-8").strip(),
            world=world.read_text(encoding="utf-8").strip(),
        )
        for page, sections in _SECTIONS.items()
    }


def checks_markdown() -> dict[str, str]:
    """The overview of all checks, a page for each family, and one for those of single lessons."""
    pages: dict[str, list[tuple[str, Check]]] = {}
    for check in CATALOGUE.values():
        pages.setdefault(check.family, []).append(("", check))
    for folder in sorted(resources.assignments().glob(f"*/{FOLDER}")):
        lesson = folder.parent
        of_lesson = [(lesson.name, check) for check in lesson_checks(lesson).values()]
        pages.setdefault("lessons", []).extend(of_lesson)
    written = {"checks.md": _rendered("checks.md", pages=pages, anchor=_anchor)}
    for family, entries in pages.items():
        about = None
        if family in families():
            about = inspect.getdoc(import_module(f"grader.checks.{family}"))
        written[f"checks/{family}.md"] = _rendered(
            "checks-family.md",
            about=about,
            entries=entries,
            check_markdown=check_markdown,
            concepts=concepts(),
        )
    return written


def explanations_markdown() -> dict[str, str]:
    """What rosgrade can tell a student: causes by symptom, and what is seen at once."""
    symptoms = [
        (_sentence(symptom), entries)
        for symptom, entries in explanations().items()
        # What others are derived from is seen by no check.
        if not symptom.__subclasses__()
    ]
    symptoms.sort(key=lambda item: item[0])
    errors = [item for item in symptoms if len(item[1]) > _MOST_ENTRIES]
    others = [item for item in symptoms if item not in errors]
    return {
        "explanations.md": _rendered("explanations.md", symptoms=others),
        "errors.md": _rendered("errors.md", symptoms=errors),
        "mistakes.md": _rendered("mistakes.md", mistakes=mistakes()),
    }


def classes_markdown() -> dict[str, str]:
    """What an own check can look at, and what it returns, by page."""
    return {
        page: _rendered(page, classes=classes, class_section=_class_section)
        for page, classes in _CLASSES.items()
    }


def _rendered(name: str, **values: Any) -> str:
    return rendered(f"docs/{name}", **values, made=_MADE, table=_table)


def _sentence(symptom: type[Any]) -> str:
    """The first line of a symptom's docstring, as a heading."""
    return (inspect.getdoc(symptom) or symptom.__name__).partition("\n")[0].rstrip(".")


def check_markdown(check: Check) -> str:
    """One check: what it asks for, what it explains, its parameters."""
    text, table = _outside_code(check.documentation), ""
    if check.parameters.model_fields:
        table = _fields_table(check.parameters)
    return _rendered("check.md", check=check, text=text, fields=table).rstrip("\n")


def _class_section(described: type) -> str:
    """A class: its docstring, and a table of its attributes, properties and methods."""
    documentation = re.sub(r":\w+:`", "`", inspect.getdoc(described) or "")
    text, _, attributes = documentation.partition("\nAttributes:\n")
    entries = re.findall(r"^    (\w+): (.*(?:\n {8}.*)*)", attributes, re.MULTILINE)
    rows = [(f"`{name}`", " ".join(words.split())) for name, words in entries]
    for name, member in vars(described).items():
        meaning = inspect.getdoc(member)
        if meaning and isinstance(member, _READABLE) and not name.startswith("_"):
            call = _call(member) if isinstance(member, FunctionType) else ""
            rows.append((f"`{name}{call}`", meaning.partition("\n")[0]))
    parts = [f"## {described.__name__}", _outside_code(text.strip().replace("``", "`"))]
    if rows:
        parts.append(_outside_code(_table(("name", "meaning"), rows).replace("``", "`")))
    return "\n\n".join(parts)


def _call(method: FunctionType) -> str:
    """How a method is called: ``(topic, at_least)``."""
    names = [name for name in inspect.signature(method).parameters if name != "self"]
    return f"({', '.join(names)})"


def _anchor(heading: str) -> str:
    """The link to a heading, as Markdown renderers make it."""
    return "#" + re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")


def _outside_code(text: str) -> str:
    """Escape what HTML would take for tags, but not in `code`."""
    parts = text.split("`")
    parts[::2] = [part.replace("<", "&lt;") for part in parts[::2]]
    return "`".join(parts)


def _fields_table(described: type[BaseModel]) -> str:
    schema = described.model_json_schema(by_alias=True)
    definitions = schema.get("$defs", {})
    # A model that holds itself is among its own definitions.
    schema = definitions.get(str(schema.get("$ref", "")).rpartition("/")[2], schema)
    required = schema.get("required", [])
    fields = {field.alias or name: field for name, field in described.model_fields.items()}
    rows = []
    properties = schema.get("properties", {}).items()
    for key, value in sorted(properties, key=lambda item: item[0] not in required):
        default = "required" if key in required else _default(value, fields[key].default)
        meaning = _outside_code(str(value.get("description", "")).replace("\n", " "))
        rows.append((f"`{key}`", _value(value, definitions), default, meaning))
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
        page, heading = _HEADINGS.get(name, ("", ""))
        link = f"[{heading}]({page}{_anchor(heading)})"
        return link if heading else _value(definitions[name], {})
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
    bounds = [f"{word} {schema[key]:g}" for key, word in _BOUNDS.items() if key in schema]
    return f", {' and '.join(bounds)}" if bounds else ""


def _default(schema: Mapping[str, Any], value: Any) -> str:
    """A default as an author would write it; ``value`` is the default itself."""
    default = schema.get("default")
    if default in (None, "", [], {}):
        return ""
    dimensions = [form.get("x-dimension") for form in (schema, *schema.get("anyOf", ()))]
    dimension = next(filter(None, dimensions), None)
    text = str(default)
    if isinstance(value, Pose):
        text = f"[{value.x_m:g}, {value.y_m:g}, {value.yaw_rad:g} rad]"
    elif isinstance(value, TimeTolerance):
        text = str(value)
    elif dimension is not None:
        text = _quantity(default, Dimension(dimension))
    elif isinstance(default, bool):
        text = text.lower()
    elif isinstance(default, list) and all(isinstance(item, str) for item in default):
        text = f"[{', '.join(default)}]"
    return f"`{text}`"


def _quantity(value: float, dimension: Dimension) -> str:
    """A quantity in the unit in which it is shortest: ``300 ms``."""
    if dimension is Dimension.TIME:
        return format_duration(value)
    forms = [f"{value / factor:g} {unit}" for unit, factor in UNITS[dimension].items()]
    return min(forms, key=len)


def _table(header: tuple[str, ...], rows: Any) -> str:
    lines = [header, ("---",) * len(header), *rows]
    cells = [[str(cell).replace("|", "\\|") for cell in line] for line in lines]
    return "\n".join(f"| {' | '.join(line)} |" for line in cells)


def documents() -> dict[str, str]:
    """Every generated file of ``docs/``, by name."""
    return {
        **assignment_markdown(),
        **checks_markdown(),
        **explanations_markdown(),
        **classes_markdown(),
    }
