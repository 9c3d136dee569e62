"""Any entry of ``stimuli``: an action of the probe in a scenario.

The first key of a stimulus, such as ``publish``, names its kind; the kinds are in ``kinds/``.
"""

from __future__ import annotations

from functools import reduce
from importlib import import_module
from operator import or_
from pkgutil import iter_modules
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import Discriminator, Tag

from grader.assignment.stimuli import kinds
from grader.assignment.stimuli.stimulus_model import KINDS, StimulusModel
from grader.spec.nearest_name import nearest


def stimulus_models() -> list[type[StimulusModel]]:
    """The models of all kinds, in the order of their modules."""
    for module in iter_modules(kinds.__path__):
        import_module(f"{kinds.__name__}.{module.name}")
    return KINDS


_MODELS = stimulus_models()
_KEYS = sorted({model.key for model in _MODELS})


def _kind(value: Any) -> str | None:
    """The tag of an entry: the name of the model whose key it has, or nearly has."""
    if isinstance(value, StimulusModel):
        return type(value).__name__
    if not isinstance(value, dict) or not value:
        return None
    keys = [str(key) for key in value]
    known = next((key for key in keys if key in _KEYS), None)
    meant = known or nearest(keys[0], _KEYS)
    fitting = (one.__name__ for one in _MODELS if one.key == meant and one.accepts(value))
    return next(fitting, None)


if TYPE_CHECKING:
    Stimulus = StimulusModel
else:
    Stimulus = Annotated[
        reduce(or_, (Annotated[one, Tag(one.__name__)] for one in _MODELS)),
        Discriminator(
            _kind,
            custom_error_type="stimulus",
            custom_error_message=f"its first key must be one of {', '.join(_KEYS)}",
        ),
    ]
