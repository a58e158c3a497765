# mypy: ignore-errors
"""Law from which pythonfmu3 makes an FMU (FMI 3, arrays): PD on position and attitude."""

import numpy as np
from pythonfmu3 import Dimension, Float64, Fmi3Causality, Fmi3Slave, Fmi3Status, Fmi3Variability
from pythonfmu3.fmi3slave import Fmi3StepResult

# pythonfmu3 0.3.4 names an argument that numpy 2.4 no longer has.
_reshape = np.reshape
np.reshape = lambda a, newshape=None, **words: (
    _reshape(a, **words) if newshape is None else _reshape(a, newshape, **words)
)
VECTORS = {
    "position_w": 3,
    "velocity_w": 3,
    "quaternion_wb": 4,
    "angular_velocity_b": 3,
    "reference_position_w": 3,
    "reference_velocity_w": 3,
    "reference_acceleration_w": 3,
    "inertia_b": 3,
}


class Fmi3Law(Fmi3Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.time = 0.0
        continuous, independent = Fmi3Variability.continuous, Fmi3Causality.independent
        self.register_variable(Float64("time", causality=independent, variability=continuous))
        for name, size in VECTORS.items():
            self._add(name, size, Fmi3Causality.input)
        self._add("mass", 1, Fmi3Causality.input)
        self._add("thrust", 1, Fmi3Causality.output)
        self._add("torque_b", 3, Fmi3Causality.output)

    def _add(self, name, size, causality):
        setattr(self, name, 0.0 if size == 1 else np.zeros(size))
        dimensions = [] if size == 1 else [Dimension(start=str(size))]
        continuous = Fmi3Variability.continuous
        self.register_variable(
            Float64(name, causality=causality, variability=continuous, dimensions=dimensions)
        )

    def do_step(self, current_time, step_size):
        self.time = current_time + step_size
        a = (
            [4.0, 4.0, 8.0] * (self.reference_position_w - self.position_w)
            + [3.5, 3.5, 5.0] * (self.reference_velocity_w - self.velocity_w)
            + self.reference_acceleration_w
        )
        w, x, y, z = self.quaternion_wb
        wanted = np.array([-a[1] / 9.81, a[0] / 9.81, 0.0])
        tilt = 2.0 * np.array([w * x + y * z, w * y - x * z, w * z])
        back = [60.0, 60.0, 12.0] * (wanted - tilt) - [12.0, 12.0, 5.0] * self.angular_velocity_b
        self.torque_b = self.inertia_b * back
        self.thrust = float(self.mass * (9.81 + a[2]))
        return Fmi3StepResult(status=Fmi3Status.ok)
