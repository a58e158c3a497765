"""A law that flies well until it does harm, for tests of the rescue."""

from __future__ import annotations

import math

import numpy as np

from control.laws import CompiledLaw, Own, Records, settings_type
from extensions.laws.parameters import PidCascadeParameters
from extensions.laws.pid_cascade import MEMORY as GOOD
from extensions.laws.pid_cascade import SETTINGS as GOOD_SETTINGS
from extensions.laws.pid_cascade import fly_one
from quadrotor.compiled import compiled
from quadrotor.parameters import parameter

KINDS = ("nan thrust", "infinite reference", "nan torque", "jolt", "no thrust", "creeps", "climbs")


class HarmParameters(PidCascadeParameters):
    """The harm that it does, and when."""

    kind: int = parameter(0, ge=0, le=len(KINDS) - 1, step=1)
    """number of the harm in KINDS"""
    after: float = parameter(1.0, unit="s", ge=0.0, le=1000.0, step=0.1)
    """time in the air until it does harm"""


SETTINGS = settings_type(HarmParameters)
SIZE = GOOD_SETTINGS.itemsize
MEMORY = np.dtype([("good", GOOD), ("time", "f8")], align=True)


@compiled(pointer=True)
def step(own: Own, records: Records, flown: bool, airborne: bool, dt: float) -> None:
    """Compute one tick; see `control.laws`."""
    memory, settings = own
    state, reference, gains, model, actuators = records
    m, s, u = memory.view(MEMORY)[0], settings.view(SETTINGS)[0], actuators[0]
    good = settings[:SIZE].view(GOOD_SETTINGS)[0]
    fly_one(
        m.good, good, state[0], reference[0], gains[0], model[0], flown, airborne, dt, actuators[0]
    )
    m.time += dt if airborne else 0.0
    since = m.time - s.after
    if since < 0.0:
        return
    if s.kind == 0:
        u.wrench[0] = math.nan
    elif s.kind == 1:
        u.motor_references[2] = math.inf
    elif s.kind == 2:
        u.wrench[1] = math.nan
    elif s.kind == 3:
        u.wrench[1] += 2.0
    elif s.kind == 4:
        u.wrench[0] = 0.0
    else:
        k = 8.0 * since
        if s.kind == 5:
            k = 0.0
            u.motor_references[1] += 15.0 * since
        for i in range(4):
            u.motor_references[i] += k


LAW = CompiledLaw(step, MEMORY)
