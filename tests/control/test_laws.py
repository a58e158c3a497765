"""Laws of extensions whose parameters cannot be used are left out; everything else flies."""

from __future__ import annotations

import pytest

from control import laws
from quadrotor.extension import Evidence, Extension, Judged, Law
from quadrotor.extensions import Registry
from quadrotor.parameters import Parameters, parameter


class Texts(Parameters):
    mode: str = parameter("fast")
    """a text, which no compiled law can read"""


class Numbers(Parameters):
    gain: float = parameter(1.5, ge=0.0, le=9.0)
    """of the law"""


def declared(parameters: str) -> Registry:
    law = Law(name="mine", target=".law:LAW", parameters=parameters)
    extension = Extension(
        name="mine",
        summary="A law",
        protocol=1,
        offers=(law,),
        judged=(Judged(Evidence.SIMULATED, "its own test"),),
    )
    return Registry([("mine", __package__ or "", lambda: extension)])


@pytest.mark.parametrize(
    ("parameters", "why"),
    [
        (".no_such_module:Numbers", "cannot be imported"),
        (".test_laws:Missing", "cannot be imported"),
        (".test_laws:Texts", "its parameter mode is str; allowed are float, int, bool"),
    ],
)
def test_a_law_without_usable_parameters_is_left_out_with_one_line(
    parameters: str, why: str
) -> None:
    found = declared(parameters)
    assert laws._usable(found) == {}
    (line,) = found.problems
    assert line.startswith("the control law mine is left out: ")
    assert why in line
    assert "mine" not in laws._tree(found).model_fields


def test_a_law_with_numbers_has_its_component() -> None:
    found = declared(".test_laws:Numbers")
    assert list(laws._usable(found)) == ["mine"]
    assert laws._tree(found)().mine.gain == 1.5  # type: ignore[attr-defined]
    assert not found.problems
