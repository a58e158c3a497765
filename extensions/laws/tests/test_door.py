"""Laws of extensions in flight: parameters, take-off, hand-over, and rescue of those that fail."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from control import laws
from control.controller import GeometricController
from control.laws import CompiledLaw, extended, new_control_parameters, settings_of
from control.parameters import GEOMETRIC
from extensions.laws.tests.harm import KINDS
from quadrotor.extension import Extension, Law
from quadrotor.extensions import Offered, Registry
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from tests.support.lab import Lab, refusal
from tests.support.law_bench import LawBench
from vehicle.laws.laws import Laws

HERE = "extensions.laws.tests"
HARM = Law(name="harm", target=".harm:LAW", parameters=".harm:HarmParameters")
LOST = Law(name="lost", target=".nowhere:LAW")
NAMES = tuple(extended())


@pytest.fixture
def others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Add the laws of these tests to those of the extensions."""
    ours = Extension(name="ours", summary="", protocol=1, offers=(HARM, LOST))
    declared = [("ours", HERE, lambda: ours)]
    from extensions.laws.extension import EXTENSION

    declared.append(("laws", "extensions.laws", lambda: EXTENSION))
    made = Registry(declared)
    monkeypatch.setattr(laws, "registry", lambda: made)


@pytest.fixture
def fly() -> Iterator[Callable[..., Lab]]:
    """Make a lab with these settings."""
    labs: list[Lab] = []

    def made(**settings: ParameterValue) -> Lab:
        lab = Lab()
        labs.append(lab)
        lab.ready()
        lab.change({name.replace("__", "."): value for name, value in settings.items()})
        return lab

    yield made
    for lab in labs:
        lab.stack.close()


@pytest.mark.parametrize("name", NAMES)
def test_a_law_takes_off_hovers_and_lands(fly: Callable[..., Lab], name: str) -> None:
    lab = fly(control__law=name)
    lab.hovering(settling=2.0)
    external = lab.stack.law.external
    assert external is not None
    assert external.flown
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.02)
    lab.start("land")
    lab.wait_until(lambda v: not v.armed, what="landed", timeout=15)
    lab.advance()
    assert f"law {name} is ready" in lab.said
    assert f"law {name}: 0 of " in lab.said
    assert "disengaged" not in lab.said
    assert lab.parameter("control.law") == name


@pytest.mark.parametrize("name", NAMES)
def test_a_law_takes_over_in_flight_with_a_payload_and_hands_back(
    fly: Callable[..., Lab], name: str
) -> None:
    lab = fly(control__shadow_law=name, simulator__payload=0.15)
    lab.hovering(settling=4.0)
    external = lab.stack.law.external
    assert external is not None
    assert not external.flown
    heights = []
    for law in (name, GEOMETRIC):
        before = lab.height
        lab.change({"control.law": law})
        for _ in range(20):
            lab.wait(0.05)
            heights.append(abs(lab.height - before))
    assert max(heights) < 0.06
    assert "disengaged" not in lab.said


@pytest.mark.usefixtures("others")
@pytest.mark.parametrize("kind", range(5))
def test_in_the_tick_in_which_a_law_fails_the_built_in_one_already_flies(kind: int) -> None:
    control = new_control_parameters()
    store = ParameterStore(control)
    store.set({"harm.kind": kind, "harm.after": 0.041})
    law = Laws().start("harm", GeometricController(), control)
    bench = LawBench(law, control)
    bench.ticks(20)
    assert (law.failure, bench.flies_built_in) == ("", False)
    bench.ticks(1)
    why = {3: "its torque is", 4: "its thrust is"}.get(kind, "which is not finite")
    assert why in law.failure, KINDS[kind]
    assert bench.flies_built_in


@pytest.mark.usefixtures("others")
@pytest.mark.parametrize("kind", range(len(KINDS)))
def test_a_law_that_does_harm_in_flight_is_out_told_and_survived(
    fly: Callable[..., Lab], kind: int
) -> None:
    lab = fly(control__law="harm", control__harm__kind=kind, control__harm__after=2.0)
    lab.hovering(settling=0.0)
    lab.wait_until(lambda _: "disengaged" in lab.said, what="the rescue", timeout=15)
    lab.wait(2.0)
    assert lab.parameter("control.law") == GEOMETRIC
    assert lab.stack.law.external is None
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.1)


@pytest.mark.usefixtures("others")
def test_a_law_whose_code_is_missing_is_told_on_the_ground(fly: Callable[..., Lab]) -> None:
    lab = fly(control__law="lost")
    lab.advance()
    lab.advance()
    assert "extension ours: control law lost cannot be imported" in lab.said
    assert lab.parameter("control.law") == GEOMETRIC


def test_parameters_of_a_law_are_those_of_the_vehicle(fly: Callable[..., Lab]) -> None:
    lab = fly(control__law="indi", control__indi__cutoff=60.0)
    assert lab.parameter("control.indi.cutoff") == 60.0
    unknown = refusal(lambda: lab.change({"control.indi.cutof": 50.0}))
    assert "did you mean control.indi.cutoff" in unknown
    assert "5" in refusal(lambda: lab.change({"control.indi.cutoff": 1.0}))
    assert "is not one of none" in refusal(lambda: lab.change({"control.shadow_law": GEOMETRIC}))
    both: dict[str, ParameterValue] = {"control.law": "indi", "control.shadow_law": "pid_cascade"}
    assert "one external law" in refusal(lambda: lab.change(both))


@pytest.mark.parametrize("name", NAMES)
def test_settings_reach_a_law_in_their_order(name: str) -> None:
    control = new_control_parameters()
    own = getattr(control, name)
    packed = settings_of(control, name)
    kind = laws.settings_type(type(own))
    values = packed.view(kind)[0]
    assert [float(v) for v in values] == [float(getattr(own, n)) for n in type(own).model_fields]
    law = extended()[name].load()
    assert isinstance(law, CompiledLaw)
    assert not np.any(law.new_memory())


def test_a_law_cannot_have_the_name_of_a_group_of_gains() -> None:
    taken = Law(name="position", target=".indi:LAW")
    extension = Extension(name="x", summary="", protocol=1, offers=(taken,))
    registry = Registry([("x", HERE, lambda: extension)])
    found: dict[str, Offered[Law]] = registry.offers(Law, taken=laws.RESERVED)
    assert not found
    assert any("position is left out" in line for line in registry.problems)
