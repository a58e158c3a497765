"""Fly the laws of the arena on a plant that is not of quadlab: RotorPy's equations of motion.

    uv pip install rotorpy foundation-policy && python -m benchmarks second_plant

A law that was tuned on one simulation may have learnt its peculiarities. Mass, inertia, geometry
and motors are the vehicle's; rotor drag, translational lift, inflow and the drag of the body are
RotorPy's, of its Hummingbird, and no law knows of them. True state, 500 Hz, one flight for each
figure: without noise another one is the same. Beside them flies the policy RAPTOR, on the vehicle
with rotors that turn the other way, as those do on which it was trained.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from functools import partial

from benchmarks.harness import Report, Row, Size, Target
from benchmarks.peers.raptor import Raptor
from benchmarks.peers.rotorpy_plant import RotorPyPlant, ends_of, law_of
from extensions.laws.arena.cells import Disturbance, entries
from extensions.laws.arena.courses import courses
from extensions.laws.arena.flights import FIRST_SEED, fly_cell
from quadrotor.vehicle_model import VehicleModel

DISTURBANCES: dict[str, Callable[..., RotorPyPlant]] = {
    "nominal": RotorPyPlant,
    "mass + 20 %": partial(RotorPyPlant, payload=0.262),
    "wind 6 m/s": partial(RotorPyPlant, wind_x=6.0),
}
COURSES = ("8 in 4 s", "3 m x 1.5 m in 4 s")
SEED = (FIRST_SEED,)


def run(size: Size = Size.FULL) -> Report:
    """Fly each law on each course under each disturbance."""
    report = Report(
        "second_plant",
        "Control laws on RotorPy's plant",
        ["position error, mm rms, after 3 s of hover; true state at 500 Hz"],
    )
    model, there = VehicleModel(), courses()
    laws = size.some(entries().items())
    adaptive: list[float] = []
    for course in size.some(COURSES):
        own = {
            law: 1e3 * float(fly_cell(entry, Disturbance(), there[course], SEED).rms[0])
            for law, entry in laws
        }
        report.rows.append(Row(f"{course}, nominal, quadlab's plant and sensors", _shown(own)))
        for name, disturbance in size.some(DISTURBANCES.items()):
            try:
                plant = disturbance(model)
            except ImportError as error:
                report.notes.append(f"RotorPy left out: {error}")
                return report
            seconds = size.of(there[course].duration, 8.0, 0.5)
            rms = {
                law: 1e3 * plant.fly(law_of(entry.control(), model), there[course], seconds)
                for law, entry in laws
            }
            with suppress(ImportError):
                policy = Raptor(*ends_of(model))
                mirrored = disturbance(model, mirrored=True)
                rms["RAPTOR"] = 1e3 * mirrored.fly(policy.step, there[course], seconds)
            report.rows.append(Row(f"{course}, {name}", _shown(rms)))
            if "geometric_l1" in rms and name != "nominal":
                adaptive.append(rms["geometric_l1"] / rms["geometric"])
    if adaptive:
        report.targets.append(
            Target("geometric_l1 over geometric, disturbed: largest ratio", max(adaptive), 0.2)
        )
    return report


def _shown(errors: dict[str, float]) -> dict[str, float | str]:
    return {law: "crashed" if math.isnan(one) else one for law, one in errors.items()}
