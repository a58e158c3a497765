"""The limits that depend on the sensors' noise, checked in the clean and in the rough world.

    python -m benchmarks rough_world

Every figure is one that an experiment evaluates, from its log, in simulated time: with default
settings in both worlds (`simulator.preset`), and in the rough one with the results of the
experiments `drag` and `vibration` and the gain set `stiff_observer`.
"""

from __future__ import annotations

from benchmarks.flights.experiment_flight import fly
from benchmarks.harness import Report, Row, Size
from control.presets import preset_values
from quadrotor.errors import QuadlabError
from quadrotor.parameter_description import ParameterValue
from vehicle.simulator import presets

Settings = dict[str, ParameterValue]

SEEDS = 4
ROUGH: Settings = {f"simulator.{name}": value for name, value in presets.ROUGH.items()}
TUNED: Settings = {
    **ROUGH,
    **preset_values("stiff_observer"),
    "model.drag": 0.47,
    "model.drag_lever": 0.02,
    "estimation.error_state.accelerometer_noise": 0.022,
    "estimation.error_state.gyroscope_noise": 0.047,
}
"""Settings for the rough world; the noise is that of the whole vibration, not only broadband."""
CLEAN = "clean"
WORLDS: dict[str, Settings] = {CLEAN: {}, "rough": ROUGH, "rough, tuned": TUNED}
EIGHT: Settings = {"experiment.manoeuvre": "figure_eight"}
MARKER: Settings = {"estimation.estimator": "error_state", "tracker.positions_only": True}
FLIGHTS: dict[str, tuple[str, Settings]] = {
    "hover": ("hover", {}),
    "figure 8": ("figure_eight", {}),
    "figure 8, error-state": ("figure_eight", {"estimation.estimator": "error_state"}),
    "hover on a marker": ("hover", MARKER),
    "figure 8 on a marker": ("figure_eight", MARKER),
    "hover on bearings": ("bearings", {}),
    "figure 8 on bearings": ("bearings", EIGHT),
    "mass": ("mass", {}),
    "inertia": ("inertia", {}),
    "drag": ("drag", {}),
}


def run(size: Size = Size.FULL) -> Report:
    """Return the worst of each evaluated figure over the seeds, by world."""
    seeds = range(1, size.of(SEEDS, 1, 1) + 1)
    report = Report(
        "rough_world",
        "Limits in the clean and in the rough world",
        [f"simulated time, {len(seeds)} seeds, the worst of them; limits are the experiments' own"],
    )
    for name, (experiment, options) in size.some(FLIGHTS.items()):
        judged: dict[str, dict[str, float | str]] = {}
        for world, settings in WORLDS.items():
            for seed in seeds:
                try:
                    result = fly(experiment, {**settings, **options}, seed=seed).result
                except QuadlabError as error:
                    report.notes.append(f"{name}, {world}, seed {seed}: {error}")
                    continue
                for metric, limit in result.limits.items():
                    row = judged.setdefault(metric, {"limit": limit})
                    worst = max(float(row.get(world, 0.0)), result.metrics[metric])
                    row[world] = worst
        report.rows += [Row(f"{name}: {metric}", row) for metric, row in judged.items()]
    return report
