# mypy: ignore-errors
"""The example law as a slave of pythonfmu3 (FMI 3, arrays): Python in an FMU. pythonfmu3 packs this
file; `QUADLAB_ROOT` names the checkout in which the example is."""

import os
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from pythonfmu3 import Dimension, Float64, Fmi3Causality, Fmi3Slave, Fmi3Status, Fmi3Variability
from pythonfmu3.fmi3slave import Fmi3StepResult

_root = os.environ.get("QUADLAB_ROOT", "")
sys.path[:0] = [_root, str(Path(_root, "examples", "laws"))]
# pythonfmu3 0.3.4 names an argument that numpy 2.4 no longer has.
_reshape = np.reshape
np.reshape = lambda a, newshape=None, **words: (
    _reshape(a, **words) if newshape is None else _reshape(a, newshape, **words)
)
INPUTS = {
    "dt": 1,
    "flying": 1,
    "position_w": 3,
    "velocity_w": 3,
    "quaternion_wb": 4,
    "angular_velocity_b": 3,
    "reference_position_w": 3,
    "reference_velocity_w": 3,
    "reference_acceleration_w": 3,
    "reference_jerk_w": 3,
    "reference_yaw": 1,
    "reference_yaw_rate": 1,
    "mass": 1,
    "inertia_b": 3,
}
OUTPUTS = {"thrust": 1, "torque_b": 3}


class Fmi3Geometric(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        from geometric_pid import GeometricPid

        self._law, self.time = GeometricPid(), 0.0
        continuous, independent = Fmi3Variability.continuous, Fmi3Causality.independent
        self.register_variable(Float64("time", causality=independent, variability=continuous))
        for names, causality in ((INPUTS, Fmi3Causality.input), (OUTPUTS, Fmi3Causality.output)):
            for name, size in names.items():
                setattr(self, name, 0.0 if size == 1 else np.zeros(size))
                sizes = [] if size == 1 else [Dimension(start=str(size))]
                self.register_variable(
                    Float64(name, causality=causality, variability=continuous, dimensions=sizes)
                )

    def do_step(self, current_time, step_size):
        self.time = current_time + step_size
        x = SimpleNamespace(**{name: getattr(self, name) for name in INPUTS})
        self.thrust, self.torque_b = self._law.step(x)
        return Fmi3StepResult(status=Fmi3Status.ok)
