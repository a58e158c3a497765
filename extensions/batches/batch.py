"""Many flights at once on all cores: `fly_batch` of `Scenario`s.

    flights = fly_batch([Scenario(seed=k) for k in range(1000)], duration=27.0, hover=8.0)
    print(flights.summary())

Each vehicle has its own truth, model, gains, noise and trajectory. A flight depends only on its
scenario: it is the same in any batch, order and number of threads.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from itertools import count

import numpy as np
import numpy.typing as npt

from bearing_sim.tracker import TrackerParameters
from control.laws import CompiledLaw, settings_of
from control.parameters import GEOMETRIC, ControlParameters
from control.trajectories.figure_eight import FigureEight
from control.trajectories.trajectory import Trajectory, sample_many
from estimation.parameters import EstimationParameters
from extensions.batches.laws import entry, laws_of, records_of
from extensions.batches.loop import CASE, HISTORY, LATEST, OUTCOME
from extensions.batches.noise import seeded
from extensions.batches.onboard import new_onboard, new_settings
from extensions.batches.sensing import new_tracker
from quadrotor.errors import OutOfBoundsError
from quadrotor.records import STATE, Record
from quadrotor.vehicle_model import GRAVITY, VehicleModel, reference_of_thrust
from vehicle.simulator.parameters import SimulatorParameters
from vehicle.simulator.plant import PLANT, SUBSTEP, new_plant
from vehicle.simulator.sensors import new_sensors

Array = npt.NDArray[np.float64]

JUDGE_PERIOD = 0.01
"""Time, in s, between two moments at which errors are evaluated."""
CALIBRATION_SAMPLES = 500
"""Number of calibration samples: the default of the vehicle's `safety.gyro_samples`."""


def _eight() -> FigureEight:
    return FigureEight((0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Scenario:
    """One vehicle and its flight.

    Attributes:
        truth: the true vehicle, and its IMU's noise and biases; its seed and rate are not used.
        model: the controller's vehicle model; None for the truth.
        control: gains, and the law: the paper's or one of an extension.
        tracker: settings of the simulated tracker; its seed is not used.
        trajectory: flown after the hover with which `fly_batch` begins; those other than the 8 are
            sampled once for each batch, in Python.
        seed: seed of all random numbers of this flight, any whole number.
        offset_w: m, offset of the start from the trajectory's beginning.
        disturbance_w: N, a constant force.
        true_state: whether the laws get the true state, without sensors and estimator.
        whole_references: whether motor references are whole counts, as on the serial line.
        ground: whether the plant has a floor at z = 0.
        calibrated: whether the gyroscope's bias is measured at rest before the flight, Sec. 5.1.
    """

    truth: SimulatorParameters = field(default_factory=SimulatorParameters)
    model: VehicleModel | None = None
    control: ControlParameters = field(default_factory=ControlParameters)
    estimation: EstimationParameters = field(default_factory=EstimationParameters)
    tracker: TrackerParameters = field(default_factory=TrackerParameters)
    trajectory: FigureEight | Trajectory = field(default_factory=_eight)
    seed: int = 1
    offset_w: tuple[float, float, float] = (0.0, 0.0, 0.0)
    disturbance_w: tuple[float, float, float] = (0.0, 0.0, 0.0)
    true_state: bool = False
    whole_references: bool = True
    ground: bool = True
    calibrated: bool = True


@dataclass(frozen=True)
class BatchResult:
    """The outcome of each flight, in the order of the scenarios; all shapes begin with (N,).

    The figures of a crashed flight end at the crash.

    Attributes:
        outcome: OUTCOME records.
        final: the true STATE records at the end, or at the crash.
        history: HISTORY records (N, K), NaN after a crash; None when none was requested.
    """

    outcome: Record
    final: Record
    history: Record | None

    @property
    def crashed(self) -> npt.NDArray[np.bool_]:
        crashed: npt.NDArray[np.bool_] = self.outcome["crashed"] == 1
        return crashed

    def of_flown(self, name: str) -> Array:
        """Return one figure of the OUTCOME, for the flights that did not crash."""
        values: Array = self.outcome[name][~self.crashed]
        return values

    def summary(self) -> str:
        """Return one line of text: how many crashed, and medians and worst values of the others."""
        text = f"{len(self.outcome)} flights, {int(self.crashed.sum())} crashed"
        if self.crashed.all():
            return text
        rms, yaw = 1e3 * self.of_flown("position_rms"), np.degrees(self.of_flown("yaw_rms"))
        return (
            f"{text}; of the others, position error {np.median(rms):.2f} mm rms (worst "
            f"{rms.max():.2f}), yaw {np.median(yaw):.2f}° rms (worst {yaw.max():.2f})"
        )


def fly_batch(
    scenarios: Sequence[Scenario],
    duration: float,
    *,
    hover: float = 0.0,
    control_rate: float = 500.0,
    substep: float = SUBSTEP,
    history_rate: float | None = None,
    threads: int | None = None,
    others: Mapping[str, CompiledLaw] | None = None,
) -> BatchResult:
    """Fly every scenario for `duration` s; the first call compiles.

    Args:
        hover: s at the start of the trajectory before it begins; errors are evaluated after it.
        control_rate: Hz of IMU samples and onboard steps.
        substep: s, the longest integration step of the plant.
        history_rate: Hz of the sampled histories; None for no history.
        threads: number of threads, None for all cores. The results do not depend on it.
        others: laws beside those of extensions, by their names in `control.law`.

    Raises OutOfBoundsError.
    """
    period_ns, ticks = _clock(duration, control_rate)
    period = 1e-9 * period_ns
    keep_every, kept = 1, 0
    if history_rate is not None:
        keep_every = max(1, round(1.0 / (history_rate * period)))
        kept = math.ceil(ticks / keep_every)
    (cases, plants), size = prepare(scenarios), len(scenarios)
    cases["pace"]["ticks"], cases["pace"]["period_ns"] = ticks, period_ns
    cases["pace"]["substeps"] = math.ceil(period / substep - 1e-9)
    cases["pace"]["hover_ticks"] = round(hover / period)
    cases["late"] = [_late(one.truth.command_latency, period) for one in scenarios]
    cases["pace"]["judge_every"] = max(1, round(JUDGE_PERIOD / period))
    cases["pace"]["keep_every"] = keep_every
    outcome, history = np.zeros(size, OUTCOME), np.full((size, kept), np.nan, HISTORY)
    sampled = _courses(scenarios, ticks, period)
    laws = laws_of((one.control.law for one in scenarios), others or {})
    fresh, fly = new_onboard(), entry()
    turn, workers = count(), min(threads or os.cpu_count() or 1, size)

    def work() -> None:
        onboard, motors = fresh.copy(), np.zeros((2, 4))
        # Each thread has its own copies: neighbours in an array share cache lines, and two cores
        # that write to one wait for each other at every step.
        case, plant, judged = _apart(CASE), _apart(PLANT), _apart(OUTCOME)
        while (k := next(turn)) < size:  # one at a time, so that threads finish together
            one = slice(k, k + 1)
            onboard[:], case[:], plant[:], judged[:] = fresh, cases[one], plants[one], outcome[one]
            motors[:] = 0.0
            law, control = laws[scenarios[k].control.law], scenarios[k].control
            case["leads"] = law.leads
            own = law.new_memory(), settings_of(control, control.law)
            flown = case, plant, onboard, sampled[id(scenarios[k].trajectory)], judged
            fly(*flown, history[k], motors, law.step, own, records_of(case, onboard))
            plants[one], outcome[one] = plant, judged

    if workers <= 1:
        work()
    else:
        with ThreadPoolExecutor(workers) as pool:
            for done in [pool.submit(work) for _ in range(workers)]:
                done.result()
    final: Record = plants["x"].copy().view(STATE).reshape(size)
    return BatchResult(outcome, final, history if kept else None)


def _courses(scenarios: Sequence[Scenario], ticks: int, period: float) -> dict[int, Record]:
    """Return the REFERENCE records of each trajectory's periods (s), by its id; none of an 8."""
    found = {}
    for one in {id(one.trajectory): one.trajectory for one in scenarios}.values():
        rows = 0
        if not isinstance(one, FigureEight):
            rows = min(ticks, math.ceil(one.duration / period) + 1)
        found[id(one)] = sample_many(one, period * np.arange(rows, dtype=np.float64))
    return found


def _apart(kind: np.dtype[np.void]) -> Record:
    """Return one record, shape (1,), that shares no cache line with other data."""
    room = np.zeros(2 * 128 + kind.itemsize, np.uint8)
    start = -room.ctypes.data % 128
    return room[start : start + kind.itemsize].view(kind)


def _late(latency: float, period: float) -> int:
    late = round(latency / period)
    if late >= LATEST:
        raise OutOfBoundsError(
            f"simulator.command_latency = {latency:g} s is {late} periods, allowed are "
            f"{LATEST - 1}; lower the rate or the latency"
        )
    return late


def _clock(duration: float, rate: float) -> tuple[int, int]:
    if not (math.isfinite(rate) and 20.0 <= rate <= 10_000.0):
        raise OutOfBoundsError(f"control_rate is {rate:g} Hz, allowed are 20 to 10000 Hz")
    period_ns = round(1e9 / rate)
    ticks = round(duration * 1e9 / period_ns) if math.isfinite(duration) else 0
    if ticks < 1:
        raise OutOfBoundsError(
            f"duration is {duration:g} s, allowed is at least one period of {1e3 / rate:g} ms"
        )
    return period_ns, ticks


def prepare(scenarios: Sequence[Scenario]) -> tuple[Record, Record]:
    """Return CASE and PLANT records (N,), each vehicle at its start with rotors at hover speed.

    Raises OutOfBoundsError for faults with schedules, and for a tracker with too long a delay.
    """
    size = len(scenarios)
    for one in scenarios:
        if one.truth.faults or one.tracker.faults:
            raise OutOfBoundsError(
                "a batch has no faults with schedules: fly them with quadlab fly, or change the "
                "truth of a scenario"
            )
    cases, plants = np.zeros(size, CASE), np.zeros(size, PLANT)
    cases["random"] = seeded([one.seed for one in scenarios])
    made: dict[tuple[int, ...], Record] = {}  # scenarios of a batch share most of their parts
    for k, one in enumerate(scenarios):
        case, plant = cases[k : k + 1], plants[k : k + 1]
        model = one.model or one.truth
        key = (id(one.trajectory), id(model), id(one.control), id(one.estimation))
        if key not in made:
            made[key] = new_settings(_eight_of(one.trajectory), model, one.control, one.estimation)
        case["settings"] = made[key]
        if (id(one.truth),) not in made:
            made[id(one.truth),] = new_plant(one.truth)
            made[id(one.truth), 0] = new_sensors(one.truth)
        plant[:], case["sensors"] = made[id(one.truth),], made[id(one.truth), 0]
        if (id(one.tracker), 1) not in made:
            made[id(one.tracker), 1] = new_tracker(one.tracker)
        case["tracker"] = made[id(one.tracker), 1]
        case["calibration_samples"] = CALIBRATION_SAMPLES if one.calibrated else 0
        case["other_law"] = one.control.law != GEOMETRIC
        case["true_state"], case["whole_references"] = one.true_state, one.whole_references
        _place(plant, case["settings"]["eight"]["center"][0], one)
    return cases, plants


def _eight_of(trajectory: FigureEight | Trajectory) -> FigureEight:
    """Return the trajectory, or an 8 about its start."""
    if isinstance(trajectory, FigureEight):
        return trajectory
    start = sample_many(trajectory, np.zeros(1))[0]
    x, y, z = start["position_w"].tolist()
    return FigureEight((x, y, z), float(start["yaw"]))


def _place(plant: Record, center: Array, one: Scenario) -> None:
    plant["x"][0, :3] = center[:3] + one.offset_w
    plant["x"][0, 6], plant["x"][0, 9] = math.cos(0.5 * center[3]), math.sin(0.5 * center[3])
    plant["disturbance_w"] = one.disturbance_w
    m = one.truth
    thrust = m.mass * GRAVITY / (4.0 * m.thrust_efficiency)
    plant["rotor_speeds"] = reference_of_thrust(thrust, m.motor_slope, m.motor_offset)
    if not one.ground:
        plant["stiffness"] = plant["damping"] = 0.0
