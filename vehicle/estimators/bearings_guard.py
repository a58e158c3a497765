"""The guard of flight on bearings: where it may begin, its limits, and the way back to the tracker.

Below the height and outside the envelope of the parameters `beacons.*` bearings are too weak to
fly on, so hand-overs there are refused and the vehicle does not fly there on them. It returns to
the tracker automatically when `vehicle.estimators.bearings_watch` demands it and for landing; it
changes to bearings only on request.
"""

from __future__ import annotations

from collections.abc import Mapping

from control.behaviors.machine import BehaviorMachine
from control.behaviors.parameters import BehaviorParameters
from control.behaviors.table import BehaviorName
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import Record
from vehicle import mailbox
from vehicle.estimators.choice import SOURCE, Change, hands_over
from vehicle.estimators.estimator_runner import BEARINGS, POSES
from vehicle.estimators.navigation import Navigation
from vehicle.modes import Flag
from vehicle.parameters import VehicleParameters
from vehicle.safety.ground_contact import GroundContact

LAYOUT = "beacons.layout"
STEADY = (BehaviorName.HOVER, BehaviorName.VELOCITY, BehaviorName.BRAKE)
"""Behaviors in which a hand-over to bearings is allowed: they stay within the new limits."""


class BearingsGuard:
    """Decides when bearings may be used, within which limits, and when to go back to the tracker.

    Attributes:
        on: whether bearings are used, alone or with poses; if so, call `step` each tick.
        flags: bits of vehicle.modes.Flag.
    """

    def __init__(
        self,
        parameters: VehicleParameters,
        state: Record,
        navigation: Navigation,
        behaviors: BehaviorMachine,
        ground: GroundContact,
    ) -> None:
        self._parameters, self._state = parameters, state
        self._navigation, self._behaviors, self._ground = navigation, behaviors, ground
        self._alone = False
        self.on, self.flags = False, 0

    # ------------------------------------------------------------------ gates
    def check_take_off(self) -> None:
        """Raise RefusedError when the vehicle would take off on bearings."""
        if self._navigation.source == BEARINGS:
            height = self._parameters.beacons.height_min
            raise RefusedError(
                "not armed: bearings are too weak near the ground; go back to the tracker "
                f"({SOURCE} = poses), take off, and fly on bearings above {height:g} m"
            )

    def check(self, values: Mapping[str, ParameterValue], armed: bool) -> None:
        """Raise RefusedError when a change of parameters is not allowed now."""
        p, source = self._parameters.beacons, self._navigation.source
        if not armed:
            return
        if values.get(LAYOUT, p.layout) != p.layout and source != POSES:
            raise RefusedError(
                f"{LAYOUT} cannot change while the vehicle flies on bearings: go back to "
                f"the tracker first ({SOURCE} = poses)"
            )
        if hands_over(source, values):
            self._check_place()

    def _check_place(self) -> None:
        p = self._parameters.beacons
        position = self._state["position_w"][0].tolist()
        height = position[2] - self._ground.ground_z
        if not self._ground.airborne or not height >= p.height_min:
            raise RefusedError(
                f"hand-over refused: {max(height, 0.0):.2f} m above take-off; bearings are flown "
                f"on from {p.height_min:g} m (beacons.height_min)"
            )
        for axis, value, (low, high) in zip("xyz", position, self._envelope(), strict=True):
            if not low <= value <= high:
                raise RefusedError(
                    f"hand-over refused: {axis} = {value:.2f} m is outside the envelope for "
                    f"bearings; allowed {low:.2f} to {high:.2f} m (beacons.envelope_xy, "
                    "beacons.envelope_z_max)"
                )
        if self._behaviors.name not in STEADY:
            raise RefusedError(
                f"hand-over refused during {self._behaviors.name.name.lower()}, whose path may "
                "leave the envelope for bearings; brake and wait until it hovers"
            )

    # ------------------------------------------------------------------ walls
    def configure(self) -> None:
        """Set limits and flags for changed parameters or another source."""
        source = self._navigation.source
        alone, before = source == BEARINGS, self._alone
        self.on, self._alone = source != POSES, alone
        if alone:
            self.flags = int(Flag.ON_BEARINGS)
        else:
            self.flags &= ~int(Flag.ON_BEARINGS)
        walls = self._parameters.behavior
        self._behaviors.set_parameters(self._shrunk(walls) if alone else walls)
        if alone != before and self._behaviors.name is BehaviorName.VELOCITY:
            self._behaviors.request("velocity", {}, self._state, armed=True, airborne=True)

    def begin_flight(self) -> None:
        """Clear the state of the last flight, at arming."""
        self.flags &= ~int(Flag.FELL_BACK)

    def _envelope(self) -> tuple[tuple[float, float], tuple[float, float], tuple[float, float]]:
        """Return lowest and highest x, y, z (m, world axes) allowed for flight on bearings."""
        p = self._parameters.beacons
        far, low = p.envelope_xy, self._ground.ground_z + p.height_min
        return (-far, far), (-far, far), (low, p.envelope_z_max)

    def _shrunk(self, walls: BehaviorParameters) -> BehaviorParameters:
        updates = {}
        for axis, (low, high) in zip("xyz", self._envelope(), strict=True):
            updates[f"volume_{axis}_min"] = max(low, getattr(walls, f"volume_{axis}_min"))
            updates[f"volume_{axis}_max"] = min(high, getattr(walls, f"volume_{axis}_max"))
        return walls.model_copy(update=updates)

    # ------------------------------------------------------------------ the way back
    def step(self, armed: bool) -> Change | None:
        """Check one tick while bearings are used; return the way back if one is due.

        Args:
            armed: whether the vehicle is in the mode it flies in.
        """
        navigation = self._navigation
        verdict = navigation.watch.verdict
        if not self._ground.airborne:
            return None
        if verdict is not None:
            if navigation.running.reserve_ready:
                self.flags |= int(Flag.FELL_BACK)
                return self._back(f"fell back to the tracker: {verdict}", mailbox.ERROR)
            if self._alone and armed:
                navigation.refuse_bearings()
                return Change(f"no tracker to fall back to: {verdict}", mailbox.ERROR, {})
        elif (
            self._alone
            and self._behaviors.name is BehaviorName.LAND
            and navigation.running.reserve_ready
        ):
            return self._back("back to the tracker for landing", mailbox.INFO)
        return None

    def _back(self, why: str, level: int) -> Change:
        return Change(why, level, self._navigation.running.fallen_back())
