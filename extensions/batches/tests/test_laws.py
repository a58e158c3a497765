"""Laws of extensions, gusts and late commands in compiled flights."""

from __future__ import annotations

import numpy as np
import pytest

from control.laws import CompiledLaw, Own, Records
from control.parameters import ControlParameters
from control.trajectories.figure_eight import FigureEight
from extensions.batches import laws
from extensions.batches.batch import BatchResult, Scenario, fly_batch
from quadrotor.compiled import compiled
from quadrotor.errors import OutOfBoundsError
from quadrotor.extension import Law
from quadrotor.extensions import Offered
from vehicle.simulator.parameters import SimulatorParameters

SHORT = FigureEight((0.0, 0.0, 1.0), laps=1, period=4.0, ramp=2.0, yaw_amplitude=0.2)


@compiled(pointer=True)
def _half(own: Own, records: Records, flown: bool, airborne: bool, dt: float) -> None:
    """Command half a hovering vehicle's weight."""
    actuators = records[4]
    for i in range(4):
        actuators[0].motor_references[i] = 80.0
    actuators[0].scaling = 1.0
    own[0][0] = 1


HALF = CompiledLaw(_half, np.dtype([("called", "i8")]))


def fly(law: str = "geometric", **truth: float) -> BatchResult:
    made = SimulatorParameters().model_copy(update=truth)
    control = ControlParameters(law=law)
    some = [Scenario(made, control=control, trajectory=SHORT, seed=k) for k in range(3)]
    return fly_batch(some, 6.0, threads=2)


def test_a_law_of_an_extension_is_called_through_its_pointer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    offer = Law(name="half", target=f"{__name__}:HALF")
    monkeypatch.setattr(laws, "extended", lambda: {"half": Offered(offer, __name__)})
    assert fly().outcome["position_rms"].max() < 0.05
    assert fly("half").outcome["position_rms"].min() > 0.5  # it lies on the ground


def test_a_law_that_is_not_compiled_is_refused_by_name() -> None:
    with pytest.raises(OutOfBoundsError, match="'near_hovering': compiled flights have geometric"):
        fly("near_hovering")


def test_gusts_push_and_are_drawn_from_the_flight_s_own_seed() -> None:
    still, windy = fly(drag=0.3), fly(drag=0.3, gust=1.5)
    assert np.median(windy.of_flown("position_rms")) > 3.0 * np.median(
        still.of_flown("position_rms")
    )
    assert fly(drag=0.3, gust=1.5).outcome.tobytes() == windy.outcome.tobytes()
    assert len(set(windy.of_flown("position_rms").tolist())) == 3


def test_late_commands_cost_what_margin_there_is() -> None:
    now, late, too_late = fly(), fly(command_latency=0.02), fly(command_latency=0.1)
    assert not now.crashed.any()
    assert not late.crashed.any()
    assert too_late.crashed.all()
    made = SimulatorParameters(command_latency=0.1)
    with pytest.raises(OutOfBoundsError, match=r"command_latency = 0\.1 s is 100 periods"):
        fly_batch([Scenario(made)], 1.0, control_rate=1000.0)
