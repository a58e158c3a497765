"""Laws of extensions in flight: parameters, take-off, hand-over, and rescue of those that fail."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
import pytest

from control import laws
from control.controller import GeometricController
from control.geometric_law import apply_wrench
from control.laws import CompiledLaw, Own, Records, extended, new_control_parameters, settings_of
from control.parameters import GEOMETRIC
from extensions.laws.tests.harm import BAD, Harm
from quadrotor.compiled import direct
from quadrotor.extension import Extension, Law
from quadrotor.extensions import Offered, Registry
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import ACTUATORS, new_reference, new_state
from quadrotor.vehicle_model import VehicleModel
from tests.support.lab import Lab, refusal
from tests.support.law_bench import LawBench
from vehicle.laws import compiled
from vehicle.laws.laws import Laws

HERE = "extensions.laws.tests"
LOST = Law(name="lost", target=".nowhere:LAW")
NAMES = tuple(extended())


@pytest.fixture
def harm(monkeypatch: pytest.MonkeyPatch) -> Harm:
    """Return what spoils the answers of laws that are started from now on."""
    made = Harm()
    monkeypatch.setattr(compiled, "direct", made.direct)
    return made


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


@pytest.mark.parametrize(("way", "why"), BAD.items())
def test_in_the_tick_in_which_a_law_fails_the_built_in_one_already_flies(
    harm: Harm, way: str, why: str
) -> None:
    control = new_control_parameters()
    law = Laws().start("pid_cascade", GeometricController(), control)
    bench = LawBench(law, control)
    bench.ticks(20)
    assert (law.failure, bench.flies_built_in) == ("", False)
    harm.way = way
    bench.ticks(1)
    assert why in law.failure
    assert bench.flies_built_in


def test_a_law_flies_the_wrench_that_was_checked_and_no_motor_references_of_its_own(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def at_full_speed(step: Callable[..., None], *arguments: object) -> Callable[..., None]:
        code = direct(step, *arguments)

        def spoiled(own: Own, records: Records, flown: bool, airborne: bool, dt: float) -> None:
            code(own, records, flown, airborne, dt)
            records[4]["motor_references"] = 255.0

        return spoiled

    monkeypatch.setattr(compiled, "direct", at_full_speed)
    control, model = new_control_parameters(), VehicleModel().record()
    law = Laws().start("indi", GeometricController(), control)
    law.configure(control, model)
    law.flown = True
    law.becomes_ready()
    out, wanted = np.zeros(1, ACTUATORS), np.zeros(1, ACTUATORS)
    law.step(new_state(), new_reference(), True, 0.002, out)
    apply_wrench(out["wrench"].copy(), model, wanted)
    assert law.failure == ""
    assert out["motor_references"] == pytest.approx(wanted["motor_references"])


@pytest.mark.parametrize(
    ("way", "why"),
    [
        ("NaN thrust", "which is not finite"),
        ("climbs", "its thrust is"),
        ("creeps", "the position is"),
        ("spins", "the heading is"),
    ],
)
def test_a_law_that_does_harm_in_flight_is_out_told_and_survived(
    fly: Callable[..., Lab], harm: Harm, way: str, why: str
) -> None:
    lab = fly(control__law="pid_cascade")
    lab.hovering(settling=1.0)
    harm.way = way
    lab.wait_until(lambda _: "disengaged" in lab.said, what="the rescue", timeout=15)
    lab.wait(2.0)
    assert why in lab.said
    assert lab.parameter("control.law") == GEOMETRIC
    assert lab.stack.law.external is None
    assert lab.robot.truth["position_w"][0] == pytest.approx([0.0, 0.0, 1.0], abs=0.1)


def test_a_law_whose_code_is_missing_is_told_on_the_ground(
    fly: Callable[..., Lab], monkeypatch: pytest.MonkeyPatch
) -> None:
    ours = Extension(name="ours", summary="", protocol=1, offers=(LOST,))
    made = Registry([("ours", HERE, lambda: ours)])
    monkeypatch.setattr(laws, "registry", lambda: made)
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
