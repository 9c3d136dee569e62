"""JSON Schemas of the YAML files, for editors that complete and check while one types.

An editor finds a schema by a comment at the top of the file::

    # yaml-language-server: $schema=assignment.schema.json
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import Any

from pydantic.json_schema import models_json_schema

from grader.assignment.group import MODELS, OF_EACH
from grader.assignment.model import Assignment, CheckSpec
from grader.assignment.mutant import MutantFile
from grader.checks.catalogue import CATALOGUE
from grader.checks.check import Check
from grader.spec.source import Model


def assignment_schema(catalogue: Mapping[str, Check] = CATALOGUE) -> dict[str, Any]:
    """The schema of ``assignment.yaml``, with the parameters of every check."""
    parameters = [check.parameters for check in catalogue.values()]
    references, schema = _schemas(Assignment, *MODELS.values(), *parameters)
    entry = schema["$defs"][references[CheckSpec]["$ref"].rpartition("/")[2]]
    families = "|".join(sorted({check.family for check in catalogue.values()}))
    of_the_lesson = {
        "description": "A check of the package `checks/` beside this file.",
        "type": "string",
        "pattern": rf"^(?!({families})\.)[a-z]\w*\.[a-z]\w*$",
    }
    entry["properties"]["uses"] = {
        "description": entry["properties"]["uses"]["description"],
        "oneOf": [
            *({"const": name, "description": catalogue[name].title} for name in sorted(catalogue)),
            of_the_lesson,
        ],
    }
    entry["properties"]["python"] = {
        "description": entry["properties"]["python"]["description"],
        "type": "string",
        "pattern": r"^[A-Za-z_]\w*\.py:[A-Za-z_]\w*$",
    }
    entry["oneOf"] = [{"required": ["uses"]}, {"required": ["python"]}]
    entry["allOf"] = [
        _parameters_of(check, references[check.parameters]) for check in catalogue.values()
    ]
    # What a contract stands for need not be written, and for bags nothing is built.
    whole = schema["$defs"][references[Assignment]["$ref"].rpartition("/")[2]]
    bags = {"minItems": 1, "items": {"required": ["bag"]}}
    whole["required"].remove("checks")
    whole["anyOf"] = [
        {"required": ["checks", "packages"]},
        {"required": ["contract"]},
        {"required": ["checks", "scenarios"], "properties": {"scenarios": bags}},
    ]
    for key, model in MODELS.items():
        whole["properties"][key]["items"] = _with_groups(key, references[model], schema)
    return {**references[Assignment], **schema}


def _with_groups(key: str, reference: Mapping[str, Any], schema: Any) -> dict[str, Any]:
    """An entry of a list, or a group; what its members need may stand in the group."""
    model = reference["$ref"].rpartition("/")[2]
    entry = schema["$defs"][model]
    properties = entry["properties"]
    shared = {name: value for name, value in properties.items() if name not in OF_EACH}
    of_member = {name: value for name, value in properties.items() if name in OF_EACH}
    if "points" in shared:
        shared["points"] = {
            "type": "object",
            "additionalProperties": shared["points"],
            "description": "Points of the checks, by their ids.",
        }
    schema["$defs"][f"{model}InGroup"] = {
        "type": "object",
        "description": entry["description"],
        "properties": {**of_member, **_or_null(properties, besides=of_member)},
        "additionalProperties": False,
        "required": ["id"],
    }
    members = {"type": "array", "minItems": 1, "items": {"$ref": f"#/$defs/{model}InGroup"}}
    schema["$defs"][f"{model}Group"] = {
        "type": "object",
        "description": f"What several {key} have in common, and these {key}.",
        "properties": {**shared, key: {**members, "description": f"The {key} of the group."}},
        "additionalProperties": False,
        "required": [key],
    }
    group = {"$ref": f"#/$defs/{model}Group"}
    return {"if": {"required": [key]}, "then": group, "else": dict(reference)}


def _or_null(properties: Mapping[str, Any], besides: Container[str]) -> dict[str, Any]:
    """The same keys; `null` takes away what a group says."""
    null = {"type": "null"}
    return {
        name: {"anyOf": [value, null]} for name, value in properties.items() if name not in besides
    }


def mutants_schema() -> dict[str, Any]:
    """The schema of ``mutants.yaml``."""
    references, schema = _schemas(MutantFile)
    return {**references[MutantFile], **schema}


def _schemas(*models: type[Model]) -> tuple[dict[type[Model], dict[str, Any]], dict[str, Any]]:
    """A reference to each model, and the definitions that they refer to."""
    unique = dict.fromkeys(models)
    found, schema = models_json_schema([(model, "validation") for model in unique], by_alias=True)
    return {model: found[model, "validation"] for model in unique}, schema


def _parameters_of(check: Check, reference: Mapping[str, Any]) -> dict[str, Any]:
    then: dict[str, Any] = {"properties": {"with": reference}}
    if any(field.is_required() for field in check.parameters.model_fields.values()):
        then["required"] = ["with"]
    condition = {"properties": {"uses": {"const": check.name}}, "required": ["uses"]}
    return {"if": condition, "then": then}
