"""The behavior machine: it accepts requests and returns one reference per tick."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from control.behaviors.behavior import Behavior, Context, ExternalReference, Joy, TickInputs
from control.behaviors.excite import Excite
from control.behaviors.external import External
from control.behaviors.fly_to import FlyTo
from control.behaviors.follow_trajectory import FollowTrajectory
from control.behaviors.ground import Ground, rest_reference
from control.behaviors.hover import Hover
from control.behaviors.land import Land
from control.behaviors.near_hovering import EmergencyLanding, Level, NearHovering
from control.behaviors.parameters import BehaviorParameters
from control.behaviors.table import BehaviorName, behavior_of, check_transition
from control.behaviors.take_off import TakeOff
from control.behaviors.velocity import Brake, Velocity
from control.parameters import ControlParameters
from control.trajectories.extrapolation import extrapolate
from control.trajectories.feasibility import examine
from control.trajectories.figure_eight import FigureEight
from control.trajectories.limits import Limits
from control.trajectories.polynomial import Polynomial
from control.trajectories.retarget import stop
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue
from quadrotor.records import REFERENCE, Record, new_reference, new_state
from quadrotor.vehicle_model import GRAVITY, VehicleModel

BEHAVIORS: dict[BehaviorName, type[Behavior]] = {
    BehaviorName.TAKE_OFF: TakeOff,
    BehaviorName.HOVER: Hover,
    BehaviorName.FLY_TO: FlyTo,
    BehaviorName.FOLLOW_TRAJECTORY: FollowTrajectory,
    BehaviorName.VELOCITY: Velocity,
    BehaviorName.LAND: Land,
    BehaviorName.BRAKE: Brake,
    BehaviorName.EXCITE: Excite,
    BehaviorName.NEAR_HOVERING: NearHovering,
    BehaviorName.EMERGENCY_LANDING: EmergencyLanding,
    BehaviorName.EXTERNAL: External,
}
"""Behaviors that can be requested: all except GROUND."""
_ACCELERATION_Z = 8
"""Index of the vertical acceleration among the numbers of a REFERENCE."""


class BehaviorMachine:
    """The active behavior; each one starts from the reference where the last one left it.

    Args:
        parameters: stored, not copied; walls and limits apply from the next request on.
        hover_thrust: N, the weight.
        model: MODEL, shape (1,), with which trajectories are checked; the paper's vehicle if
            omitted.
        trajectories: those loaded from files before the flight, by name.

    Attributes:
        name: the active behavior's.
        level: what the microcontroller has to hold, in a behavior that it flies itself, else None.
        control: gains in use, with which steps are checked.
        landed: whether a landing looks complete: little thrust, and yet a steady velocity.
        unloading: share of the weight by which the reference lets the thrust fall, to test for the
            ground.
        aborted: why a behavior ended by itself early, until `pop_aborted`.
        outside: the newest reference of another program; written between ticks.
    """

    def __init__(
        self,
        parameters: BehaviorParameters,
        hover_thrust: float = 1.308 * GRAVITY,
        *,
        model: Record | None = None,
        trajectories: Mapping[str, Polynomial] | None = None,
    ) -> None:
        self.parameters = parameters
        self.hover_thrust = hover_thrust
        self.model = VehicleModel().record() if model is None else model
        self.trajectories: Mapping[str, Polynomial] = trajectories or {}
        self.control = ControlParameters()
        self.landed = False
        self.unloading = 0.0
        self.aborted = ""
        self.outside = ExternalReference()
        self._inputs = TickInputs()
        self._change(Ground())
        self._reference = new_reference()
        self._floats = self._reference.view("f8")
        self._target: Record | None = None
        self._target_floats = self._floats
        _compile(parameters)

    @property
    def progress(self) -> float:
        """Return the completed share of the behavior, 0..1; 0 for a behavior without an end."""
        return self._behavior.progress

    def set_parameters(self, parameters: BehaviorParameters) -> None:
        """Set walls and limits for the next request; `parameters` is stored, not copied."""
        self.parameters = parameters

    def set_control(self, control: ControlParameters) -> None:
        """Set the gains in use."""
        self.control = control

    def set_model(self, model: Record) -> None:
        """Set the MODEL, shape (1,), with which trajectories are checked."""
        self.model = model

    def set_mass(self, mass: float) -> None:
        """Set the mass (kg) for the hover thrust."""
        self.hover_thrust = mass * GRAVITY

    def set_trajectories(self, trajectories: Mapping[str, Polynomial]) -> None:
        """Set the trajectories that were loaded from files, by name."""
        self.trajectories = trajectories

    def pop_aborted(self) -> str:
        """Return why a behavior ended by itself early since the last call, "" when none did."""
        reason, self.aborted = self.aborted, ""
        return reason

    def reset(self) -> None:
        """Return to the ground state at once, when the motors are disarmed or cut."""
        self._change(Ground())
        self.landed, self.unloading = False, 0.0

    def request(
        self,
        name: str,
        arguments: Mapping[str, ParameterValue],
        state: Record,
        armed: bool,
        airborne: bool,
    ) -> None:
        """Start a behavior now.

        A hover requested in motion brakes first. Raises RefusedError or ParameterError, without
        changes.
        """
        wanted = behavior_of(name)
        check_transition(self.name, wanted, armed, airborne)
        if self.name is BehaviorName.GROUND:
            if not _finite(state):
                raise RefusedError(
                    f"{name} refused: the vehicle does not know where it is; "
                    "check the tracker and wait for a pose"
                )
            rest_reference(state, self._reference)
        context = self._context(state)
        if wanted is BehaviorName.HOVER and self._moving():
            wanted = BehaviorName.BRAKE
        self._change(BEHAVIORS[wanted].start(context, arguments))
        self.landed = False

    def step(
        self,
        stamp_ns: int,
        dt: float,
        state: Record,
        joy: Joy | None,
        thrust: float,
        reference: Record,
    ) -> None:
        """Run one tick: advance the reference and write it into `reference`, shape (1,).

        Args:
            stamp_ns: the vehicle's clock, as for the stamps of `joy`.
            dt: s since the last tick.
            joy: the newest sticks, or None.
            thrust: N, commanded in the last tick.
        """
        tick = self._inputs
        tick.stamp_ns, tick.dt, tick.state, tick.joy, tick.thrust = stamp_ns, dt, state, joy, thrust
        is_done = self._behavior.step(tick, self._reference)
        if self.name is BehaviorName.LAND:
            self.landed = is_done
        elif is_done:
            self._finish()
        # As floats, through a view made once: copying a structured record takes 2.5 µs.
        if reference is not self._target:
            self._target, self._target_floats = reference, _floats(reference)
        self._target_floats[:] = self._floats
        if self.unloading:
            self._target_floats[_ACCELERATION_Z] -= self.unloading * GRAVITY

    def _finish(self) -> None:
        context = self._context()
        ended = self._behavior
        aborted = ended.aborted if isinstance(ended, Excite | External) else ""
        self.aborted = aborted or self.aborted
        if aborted or isinstance(ended, External):
            self._change(Brake.start(context, {}))
        else:
            self._change(Hover.start(context, {}))

    def _change(self, behavior: Behavior) -> None:
        self._behavior, self.name = behavior, behavior.name
        self.level = behavior if isinstance(behavior, Level) else None

    def _context(self, state: Record | None = None) -> Context:
        return Context(
            self._reference.copy(),
            self.parameters,
            hover_thrust=self.hover_thrust,
            model=self.model,
            trajectories=self.trajectories,
            control=self.control,
            state=state,
            outside=self.outside,
            stamp_ns=self._inputs.stamp_ns,
        )

    def _moving(self) -> bool:
        return bool(self._floats[3:15].any() or self._floats[16:].any())


def _finite(state: Record) -> bool:
    return math.isfinite(float(state["position_w"].sum() + state["quaternion_wb"].sum()))


def _floats(reference: Record) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    """Return a view (18,) of a reference record of shape (1,), which may be inside a TICK."""
    if reference.shape != (1,) or reference.dtype != REFERENCE:
        raise ValueError(f"a reference record of shape (1,) is needed, not {reference.shape}")
    return reference.view("f8")


def _compile(parameters: BehaviorParameters) -> None:
    """Call every compiled function once; the first call in flight would be seconds late."""
    reference, state = new_reference(), new_state()
    rest_reference(state, reference)
    context = Context(reference.copy(), parameters, 1.0)
    for behavior in (Brake.start(context, {}), Land.start(context, {}), Hover.start(context, {})):
        behavior.step(TickInputs(state=state), reference)
    examine(FigureEight((0.0, 0.0, 0.0)), VehicleModel().record(), Limits())
    stop(reference, 1.0)[0].sample(0.0, reference)
    extrapolate(context.reference, 0.0, reference)
