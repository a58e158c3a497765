"""Parameter store: every refusal has its reason, and no change is partial."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from pydantic import ConfigDict, field_validator

from quadrotor.errors import (
    OutOfBoundsError,
    ParameterError,
    QuadlabError,
    ReadOnlyError,
    UnknownParameterError,
    WrongTypeError,
)
from quadrotor.parameter_description import ParameterValue, parse_text
from quadrotor.parameters import Parameters, ParameterStore, parameter


class Motor(Parameters):
    gain: float = parameter(
        2.0, unit="1/s", ge=0.0, le=10.0, step=0.1, description="how eager it is"
    )
    poles: int = parameter(14, ge=2, description="number of poles")
    offset: float = parameter(0.0, le=5.0, description="no lower bound")
    enabled: bool = parameter(True, description="whether it turns")
    kind: str = parameter("brushless", choices=("brushless", "brushed"), description="which one")
    port: str = parameter("/dev/ttyS0", read_only=True, description="where it is")


class Inner(Parameters):
    motor: Motor = Motor()


class Vehicle(Parameters):
    motor: Motor = Motor()
    inner: Inner = Inner()


@pytest.fixture
def store() -> ParameterStore:
    return ParameterStore(Vehicle())


def test_names_are_flat_paths_over_the_tree(store: ParameterStore) -> None:
    assert store.names[0] == "motor.gain"
    assert "inner.motor.poles" in store.names
    assert len(store.names) == 12
    assert store.get("inner.motor.poles") == 14
    assert store.values()["motor.kind"] == "brushless"


def test_a_description_says_all_a_slider_needs(store: ParameterStore) -> None:
    d = store.description("motor.gain")
    assert (d.name, d.type, d.default, d.unit) == ("motor.gain", "float", 2.0, "1/s")
    assert (d.minimum, d.maximum, d.step, d.read_only) == (0.0, 10.0, 0.1, False)
    assert d.description == "how eager it is"
    poles, kind = store.description("motor.poles"), store.description("motor.kind")
    assert (poles.type, poles.minimum, poles.maximum) == ("int", 2.0, None)
    assert (kind.type, kind.choices) == ("str", ("brushless", "brushed"))
    assert store.description("motor.port").read_only
    assert len(store.descriptions()) == len(store.names)


def test_a_change_reaches_the_model_and_counts_a_revision() -> None:
    root = Vehicle()
    store = ParameterStore(root)
    applied = store.set({"motor.gain": 3, "motor.enabled": False})
    assert applied == {"motor.gain": 3.0, "motor.enabled": False}
    assert isinstance(root.motor.gain, float)
    assert root.motor.gain == 3.0
    assert root.inner.motor.gain == 2.0  # a sibling of the same class is another object
    assert store.revision == 1
    store.set({})
    assert store.revision == 1


@pytest.mark.parametrize("bad", [{"motor.gain": 99.0}, {"motor.gian": 1.0}, {"motor.port": "x"}])
def test_one_bad_value_changes_nothing_at_all(
    store: ParameterStore, bad: Mapping[str, float | str]
) -> None:
    with pytest.raises(ParameterError):
        store.set({"motor.poles": 12, **bad})
    assert store.get("motor.poles") == 14
    assert store.revision == 0


@pytest.mark.parametrize(
    ("name", "value", "error", "text"),
    [
        ("motor.gain", 11.0, OutOfBoundsError, "11 is out of bounds; allowed 0 to 10 1/s"),
        ("motor.gain", -1, OutOfBoundsError, "default 2.0"),
        ("motor.gain", float("nan"), OutOfBoundsError, "nan is not a finite number"),
        ("motor.gain", float("inf"), OutOfBoundsError, "inf is not a finite number"),
        ("motor.gain", "2", WrongTypeError, "must be a number, not '2'"),
        ("motor.gain", True, WrongTypeError, "must be a number, not True"),
        ("motor.gain", None, WrongTypeError, "must be a number, not None"),
        ("motor.poles", 2.5, WrongTypeError, "must be an integer"),
        ("motor.poles", 1, OutOfBoundsError, "allowed from 2"),
        ("motor.offset", 6, OutOfBoundsError, "allowed up to 5"),
        ("motor.enabled", 1, WrongTypeError, "must be true or false"),
        ("motor.kind", "steam", OutOfBoundsError, "not one of brushless, brushed"),
        ("motor.kind", 3, WrongTypeError, "must be text, not 3; allowed brushless, brushed, def"),
        ("motor.port", "/dev/null", ReadOnlyError, "set it at the start with --set motor.port="),
        ("motor.gian", 1.0, UnknownParameterError, "did you mean motor.gain"),
        ("motor.duration", 1.0, UnknownParameterError, "motor has "),
        ("zzz", 1.0, UnknownParameterError, "lists them all"),
    ],
)
def test_every_refusal_says_what_came_and_what_was_allowed(
    store: ParameterStore,
    name: str,
    value: ParameterValue | None,
    error: type[Exception],
    text: str,
) -> None:
    before = store.values()
    with pytest.raises(error) as caught:
        store.check(name, value)
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)
    assert isinstance(caught.value, QuadlabError)
    assert store.values() == before


def test_whole_floats_are_whole_numbers_and_bounds_themselves_are_allowed(
    store: ParameterStore,
) -> None:
    assert store.check("motor.poles", 12.0) == 12
    assert isinstance(store.check("motor.poles", 12.0), int)
    assert store.check("motor.gain", 0) == 0.0
    assert store.check("motor.gain", 10) == 10.0


def test_unknown_names_are_refused_by_get_and_description_too(store: ParameterStore) -> None:
    with pytest.raises(UnknownParameterError):
        store.get("motor.nothing")
    with pytest.raises(UnknownParameterError):
        store.description("motor.nothing")


def test_preset_sets_read_only_parameters_before_the_start(store: ParameterStore) -> None:
    store.preset({"motor.port": "/dev/ttyS1"})
    assert store.get("motor.port") == "/dev/ttyS1"
    with pytest.raises(WrongTypeError):
        store.preset({"motor.port": 3})
    with pytest.raises(UnknownParameterError):
        store.preset({"motor.prot": "x"})


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("motor.gain", "2.5", 2.5),
        ("motor.gain", "1e0", 1.0),
        ("motor.poles", "12", 12),
        ("motor.enabled", "False", False),
        ("motor.enabled", "true", True),
        ("motor.kind", "brushed", "brushed"),
    ],
)
def test_typed_text_is_read_as_its_type(
    store: ParameterStore, name: str, text: str, value: ParameterValue
) -> None:
    assert parse_text(store.description(name), text) == value


@pytest.mark.parametrize(
    ("name", "text", "error"),
    [
        ("motor.gain", "fast", WrongTypeError),
        ("motor.gain", "", WrongTypeError),
        ("motor.gain", "nan", OutOfBoundsError),
        ("motor.gain", "1e9", OutOfBoundsError),
        ("motor.enabled", "1", WrongTypeError),
        ("motor.kind", "steam", OutOfBoundsError),
    ],
)
def test_typed_text_that_does_not_fit_is_refused(
    store: ParameterStore, name: str, text: str, error: type[Exception]
) -> None:
    with pytest.raises(error):
        parse_text(store.description(name), text)


def test_a_field_without_a_description_is_a_programmers_mistake() -> None:
    class Bare(Parameters):
        value: float = 1.0

    class Undescribed(Parameters):
        value: float = parameter(1.0)

    with pytest.raises(TypeError, match="not made with"):
        ParameterStore(Bare())
    with pytest.raises(TypeError, match="value has no description"):
        ParameterStore(Undescribed())


def test_the_docstring_below_a_field_is_its_description() -> None:
    class Described(Parameters):
        value: float = parameter(1.0)
        """longer than
        a line"""

    assert ParameterStore(Described()).description("value").description == "longer than a line"


def test_numpy_numbers_are_numbers(store: ParameterStore) -> None:
    # np.float64 is a float; any other type must not pass half converted.
    assert store.check("motor.gain", np.float64(3.0)) == 3.0
    assert type(store.check("motor.gain", np.float64(3.0))) is float


def test_a_fields_own_refusal_leaves_the_others_as_they_were() -> None:
    class Picky(Parameters):
        model_config = ConfigDict(validate_assignment=True)

        first: float = parameter(1.0, ge=0.0, le=9.0, description="set before the refusal")
        word: str = parameter("fine", description="no spaces")

        @field_validator("word")
        @classmethod
        def _one_word(cls, text: str) -> str:
            if " " in text:
                raise OutOfBoundsError(f"word = {text!r} has a space")
            return text

    picky = Picky()
    store = ParameterStore(picky)
    with pytest.raises(OutOfBoundsError, match="has a space"):
        store.set({"first": 2.0, "word": "two words"})
    assert (picky.first, picky.word, store.revision) == (1.0, "fine", 0)
