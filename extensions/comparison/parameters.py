"""The estimators that the station runs in parallel with the vehicle's own, as one text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from pydantic import ConfigDict, field_validator

from quadrotor.errors import OutOfBoundsError
from quadrotor.parameters import Parameters, parameter

MAX_ESTIMATORS = 6
"""Maximum number of estimators at once: each uses a share of the station's only interpreter."""
PRESET_OF: Mapping[str, str] = {"complementary": "resolved"}
"""Presets for names given without one; other names use the defaults."""


class EstimatorChoice(NamedTuple):
    """A word `name` or `name:preset`, split; preset "" means the default parameters."""

    word: str
    name: str
    preset: str


class ComparisonParameters(Parameters):
    """Parameters of the estimators that are only compared.

    The text is checked on each assignment; a wrong one raises OutOfBoundsError and changes nothing.
    """

    model_config = ConfigDict(validate_assignment=True)

    estimators: str = parameter("")
    """estimators run at the station on telemetry and bearings, to be compared: words like
    error_state or complementary:paper, at most 6; nothing for none"""

    @field_validator("estimators")
    @classmethod
    def _check_estimators(cls, text: str) -> str:
        parse_estimators(text)
        return text


def parse_estimators(text: str) -> tuple[EstimatorChoice, ...]:
    """Return the choices of a text, in order. Raises OutOfBoundsError with what is allowed."""
    words = text.split()
    if not words:
        return ()  # without importing the registry: an unused station loads no estimator
    from estimation import registry
    from estimation.parameters import PRESETS

    choices = []
    for word in words:
        name, colon, preset = word.partition(":")
        if name not in registry.names() or (colon and preset not in PRESETS):
            raise OutOfBoundsError(
                f"estimators = {text!r}: {word!r} is not one; allowed are "
                f"{', '.join(registry.names())}, each alone or with a preset "
                f"({', '.join(PRESETS)}) like complementary:paper, words separated by spaces"
            )
        choices.append(EstimatorChoice(word, name, preset or PRESET_OF.get(name, "")))
    twice = [word for k, word in enumerate(words) if word in words[:k]]
    if twice:
        raise OutOfBoundsError(f"estimators = {text!r} has {twice[0]!r} twice; name each once")
    if len(words) > MAX_ESTIMATORS:
        raise OutOfBoundsError(
            f"estimators = {text!r} are {len(words)}; allowed are at most {MAX_ESTIMATORS} at once"
        )
    return tuple(choices)
