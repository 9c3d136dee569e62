"""JSON Schemas of the YAML files, for editors that complete and check while one types.

An editor finds a schema by a comment at the top of the file::

    # yaml-language-server: $schema=assignment.schema.json
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic.json_schema import models_json_schema

from grader.assignment.model import Assignment, CheckSpec
from grader.assignment.mutant import MutantFile
from grader.checks.catalogue import CATALOGUE
from grader.checks.check import Check
from grader.spec.source import Model


def assignment_schema(catalogue: Mapping[str, Check] = CATALOGUE) -> dict[str, Any]:
    """The schema of ``assignment.yaml``, with the parameters of every check."""
    parameters = [check.parameters for check in catalogue.values()]
    references, schema = _schemas(Assignment, CheckSpec, *parameters)
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
    # What a contract stands for need not be written.
    whole = schema["$defs"][references[Assignment]["$ref"].rpartition("/")[2]]
    made = {"packages", "checks"}
    whole["required"] = [name for name in whole["required"] if name not in made]
    whole["anyOf"] = [{"required": sorted(made)}, {"required": ["contract"]}]
    schema["$defs"]["Scenario"]["required"].remove("launch")
    return {**references[Assignment], **schema}


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
