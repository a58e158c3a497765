"""The experiments by name: those of quadlab itself, then those of extensions."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from quadrotor.errors import UsageError
from quadrotor.extension import Experiment as Offer
from quadrotor.extensions import Offered, registry

if TYPE_CHECKING:
    from console.experiments.client import Experiment

_OWN = (
    Offer(name="figure_eight", target=".figure_eight:FigureEight"),
    Offer(name="hover", target=".hover:Hover"),
    Offer(name="own_behavior", target=".own_behavior:OwnBehavior"),
    Offer(name="bearings", target=".bearings:BearingsExperiment"),
    Offer(name="gyroscope", target=".gyroscope:Gyroscope", calibration="gyroscope"),
    Offer(name="accelerometer", target=".accelerometer:Accelerometer", calibration="accelerometer"),
    Offer(name="motor_bench", target=".motor_bench:MotorBench", calibration="motor"),
    Offer(name="mass", target=".mass:MassExperiment", calibration="mass"),
    Offer(name="inertia", target=".inertia:InertiaExperiment", calibration="inertia"),
)


@lru_cache(maxsize=1)
def experiments() -> dict[str, Offered[Offer]]:
    """Return all experiments by name, without importing any."""
    own = {offer.name: Offered(offer, __package__) for offer in _OWN}
    return own | registry().offers(Offer, own)


def find(name: str, vehicle: str = "quad1") -> Experiment:
    """Return the experiment with this name.

    Raises UsageError, which lists the existing ones, or says why its code cannot be imported.
    """
    known = experiments()
    if name not in known:
        raise UsageError(f"unknown experiment {name!r}; there are {', '.join(known)}")
    experiment: Experiment = known[name].load()(vehicle)
    return experiment
