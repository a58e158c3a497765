"""Wrong measurements in flight: whether the estimate recovers, is handed over, or is lost silently.

The vehicle hovers or flies the figure 8 in simulated time. Then one or more things go wrong with
the poses or bearings that it flies on, and it is watched for some seconds. The flight is

- recovered: it flies on and at the end its estimate is near the truth again,
- handed_over: another estimator or the tracker took over, or the vehicle landed by itself,
- refused: it was not armed, or the hand-over to bearings was refused,
- reported: the estimate is off at the end, and flags or `converged` report it,
- silent: the estimate was off for a while and nothing reported it,
- lost: it left its volume, turned over or hit the ground hard.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from bearing_sim.beacons import Beacons, format_layout, parse_layout
from benchmarks.campaigns.watching import Watching
from benchmarks.flights.watched_flight import Observed
from estimation.estimator import Estimator
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import Parameters, parameter
from quadrotor.records import POSE_SAMPLE
from quadrotor.rotations import (
    norm,
    quaternion_conjugate,
    quaternion_exp,
    quaternion_log,
    quaternion_multiply,
)
from vehicle.modes import Flag

GAP = 2.0
"""Duration, in s, of a gap without bearings or poses."""
HELD = 0.5
"""Time, in s, for which an estimate must be off to count as off."""
NEAR = {"poses": (0.10, 10.0), "bearings": (0.30, 10.0)}
"""Largest error of an estimate, in m and deg, by its measurements; on bearings as
`fallback.disagreement_max` allows."""
TRACKER, BEARINGS = "tracker", "bearings"
OUTLIERS, MISSING, BEACON, LAYOUT, CLOCK, START, THROWN = FAULTS = (
    "outliers 20 %",
    "gap of 2 s",
    "one beacon off by 5 deg",
    "layout wrong by 10 cm",
    "clock step",
    "begun 1 m and 60 deg off",
    "in flight thrown off by so much",
)
ONLY_BEARINGS = BEACON, LAYOUT
"""Faults of the beacons. THROWN is used only alone: with others the attitude may be unobservable.
"""
SEVERAL = "several at once"
VERDICTS = "recovered", "handed_over", "reported", "refused", "silent", "lost"
TELLING = (
    Flag.NO_POSE | Flag.TRACKER_JUMPED | Flag.ESTIMATE_DRIFTED | Flag.BEACON_OFF | Flag.RESCUED
)
"""Flags that report that the estimate may be off; refused measurements do not, as outliers are
refused."""
HANDED = Flag.RESCUED | Flag.FELL_BACK
IMPACT = 1.0
"""Touch-down speed, in m/s, beyond which a vehicle is lost."""


class HostileFlight(Observed):
    """A flight whose measurements can be made wrong.

    Attributes:
        source: of the measurements that it flies on, "poses" or "bearings".
        largest: m, largest error of the estimate. silent: s, longest time for which it was off
            without a report.
    """

    def __init__(self, *others: Any, **named: Any) -> None:
        super().__init__(*others, **named)
        self.source = "poses"
        self.chance = np.random.default_rng((self.parameters.simulator.seed, 21))
        self.silent = self.largest = self.off = 0.0
        self.handed = self.left = False
        self._watching, self._good_ns = False, 0

    def set(self, part: str, **values: ParameterValue) -> None:
        """Change the tracker or the bearings, without the bounds of parameters."""
        of = self._tracker if part == TRACKER else self._bearings
        for name, value in values.items():
            of.parameters.__dict__[name] = value

    @property
    def flown_on(self) -> str:
        """Return the sensor whose measurements are made wrong."""
        return TRACKER if self.source == "poses" else BEARINGS

    def begin(self, *, bearings: bool, tracker: bool, thrown_off: bool) -> None:
        """Take off, hand over to bearings and start to fly.

        Args:
            bearings: whether to fly on bearings. tracker: whether the tracker stays then.
            thrown_off: whether the estimator to fly on starts at a wrong place.

        Raises RefusedError.
        """
        navigation = self.stack.navigation
        estimator = self.parameter("estimation.estimator")
        self.source = "bearings" if bearings else "poses"
        self.wait_until(lambda v: v.mode == "ready", what="ready", timeout=20)
        self.wait(0.2)
        if bearings:
            self.change({"estimation.shadow": estimator, "estimation.shadow_source": "bearings"})
        elif thrown_off:
            self._throw_off(navigation.active)
            self.wait(3.0)
        self.hover(1.0, 1.5)
        if bearings:
            if thrown_off and navigation.shadow is not None:
                self._throw_off(navigation.shadow)
            self._hand_over()
            if not tracker:
                self.set(TRACKER, drop_out=1.0)
                self.wait(1.0)
        if self.chance.random() < 0.5:
            self.start("follow_trajectory", trajectory="figure_eight", laps=3)
            self.wait(3.0)
        self._watching, self._good_ns = True, self.stack.stamp_ns
        self.forget()

    def _hand_over(self) -> None:
        for patience in range(10, -1, -1):
            try:
                self.change({"estimation.source": "bearings", "estimation.shadow": "none"})
                break
            except RefusedError:
                if patience == 0:
                    raise
                self.wait(0.5)
        self.wait(1.0)

    def go_wrong(self, fault: str) -> None:
        """Inject a fault now."""
        on, chance = self.flown_on, self.chance
        if fault == OUTLIERS:
            self.set(TRACKER, outliers=0.2, outlier_attitude=30.0)
            if on == BEARINGS:
                self.set(BEARINGS, swap=0.2)
        elif fault == MISSING:
            self.set(on, drop_out=1.0)
        elif fault == BEACON:
            axis = chance.normal(size=3)
            x, y, z = 5.0 * axis / np.linalg.norm(axis)
            self.set(BEARINGS, beacon_bias=f"{chance.integers(1, 5)} {x} {y} {z}")
        elif fault == LAYOUT:
            places = parse_layout("paper")
            off = chance.normal(size=places.positions_w.shape)
            off *= 0.1 / np.linalg.norm(off, axis=1, keepdims=True)
            moved = Beacons(places.ids, places.positions_w + off)
            self.set(BEARINGS, layout=format_layout(moved))
        elif fault == CLOCK:
            step = 10.0 ** chance.uniform(-1.7, 0.0) * chance.choice((-1.0, 1.0))  # 20 ms to 1 s
            self.set(on, stamp_error=float(step))
        elif fault == THROWN:
            self._throw_off(self.stack.navigation.active)

    def mend(self, fault: str) -> None:
        """End a gap."""
        if fault == MISSING:
            self.set(self.flown_on, drop_out=0.0)

    def _throw_off(self, estimator: Estimator) -> None:
        """Start an estimator 1 m and 60 deg off the truth."""
        away, axis = (v / norm(v) for v in self.chance.normal(size=(2, 3)))
        turn = quaternion_exp(math.radians(60.0) * axis)
        pose = np.zeros(1, POSE_SAMPLE)
        pose["stamp_ns"] = self.stack.stamp_ns
        pose["position_w"] = self._true_position_w + away
        pose["quaternion_wb"] = quaternion_multiply(turn, self._true_quaternion_wb)
        estimator.initialize(pose)

    # ------------------------------------------------------------------ the truth
    def advance(self) -> None:
        super().advance()
        if not self._watching:
            return
        stack, place = self.stack, self._true_position_w
        self.off = float(np.linalg.norm(stack.state["position_w"][0] - place))
        back = quaternion_conjugate(stack.state["quaternion_wb"][0])
        turn = math.degrees(
            norm(quaternion_log(quaternion_multiply(back, self._true_quaternion_wb)))
        )
        flags = int(stack.status["flags"][0])
        landing = self.view().behavior in ("land", "ground") or self.view().mode != "armed"
        if not landing:
            self.largest = max(self.largest, self.off)
        self.handed = self.handed or bool(flags & HANDED) or landing
        self.near = self.off < NEAR[self.source][0] and turn < NEAR[self.source][1]
        self.says = landing or bool(flags & TELLING) or not stack.estimator.converged
        now_ns = stack.stamp_ns
        if self.near or self.says:
            self._good_ns = now_ns
        self.silent = max(self.silent, 1e-9 * (now_ns - self._good_ns))
        volume = self.parameters.behavior
        x, y, z = place.tolist()
        inside = volume.volume_x_min <= x <= volume.volume_x_max
        inside = inside and volume.volume_y_min <= y <= volume.volume_y_max
        inside = (inside and z <= volume.volume_z_max) or landing
        self.left = self.left or not inside

    @property
    def verdict(self) -> str:
        """Return the outcome in the words of the module's docstring."""
        if self.left or self.hardest > IMPACT or self.most_tilted > math.radians(80.0):
            return "lost"
        if self.silent > HELD:
            return "silent"
        if self.handed:
            return "handed_over"
        return "recovered" if self.near else "reported"


class HostileOptions(Parameters):
    """Options: what goes wrong, and on what the vehicle flies."""

    fault: str = parameter(OUTLIERS, choices=(*FAULTS, SEVERAL))
    """of the measurements"""
    on_bearings: bool = parameter(False)
    """whether it flies on bearings rather than on poses"""
    tracker: bool = parameter(True)
    """whether the tracker stays while it flies on bearings"""
    watched: float = parameter(8.0, unit="s", ge=1.0, le=60.0)
    """after the first fault"""


class HostileFlights(Watching):
    """A flight whose measurements lie."""

    name, flight = "hostile_flights", HostileFlight

    def __init__(self) -> None:
        super().__init__()
        self.parameters: HostileOptions = HostileOptions()

    def fly(self, client: HostileFlight) -> None:
        """Fly, make the measurements wrong, and watch."""
        options, chance = self.parameters, client.chance
        faults = self._faults(chance)
        latest = 3.0 if len(faults) > 1 else 0.5
        try:
            client.begin(
                bearings=options.on_bearings, tracker=options.tracker, thrown_off=START in faults
            )
        except RefusedError:
            self._keep("refused", client)
            return
        plan = [(float(chance.uniform(0.0, latest)), client.go_wrong, one) for one in faults]
        plan += [(t + GAP, client.mend, one) for t, _, one in plan]
        passed = 0.0
        for t, act, one in sorted(plan, key=lambda item: item[0]):
            client.wait(t - passed)
            passed = t
            act(one)
        client.wait(options.watched + latest - passed)
        self._keep(client.verdict, client)

    def _faults(self, chance: np.random.Generator) -> list[str]:
        options = self.parameters
        if options.fault != SEVERAL:
            return [options.fault]
        able = [
            one
            for one in FAULTS
            if one != THROWN and (options.on_bearings or one not in ONLY_BEARINGS)
        ]
        several = int(chance.integers(2, len(able) + 1))
        return [str(one) for one in chance.permutation(able)[:several]]

    def _keep(self, verdict: str, flight: HostileFlight) -> None:
        self.found = {name: float(name == verdict) for name in VERDICTS}
        self.found |= {
            "largest_m": flight.largest,
            "final_m": flight.off,
            "silent_s": flight.silent,
        }
        self.limits = {"silent": 0.0, "lost": 0.0}
