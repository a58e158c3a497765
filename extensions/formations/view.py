"""Weights of edges, which fall before an edge leaves the observer's field of view or range."""

from __future__ import annotations

import math

from bearing_sim.bearing_parameters import BearingParameters
from bearing_sim.emulator import axis_of
from extensions.formations.mathematics.steering import edge_weight
from quadrotor.plain_rotations import Triple

MARGIN = math.radians(10.0)
"""rad inside the border of the field of view in which the weight of an edge falls to 0."""
SHARE = 0.15
"""Share of the largest range, before its end, in which the weight falls to 0."""
COUNTED = 0.5
"""Weight from which an edge counts for the rigidity."""


class View:
    """The field of view and range of the sensor of each vehicle, which is taken as level."""

    def __init__(self, parameters: BearingParameters) -> None:
        self._axis = axis_of(parameters)
        self._half = math.radians(0.5 * parameters.field_of_view)
        self._range = parameters.range_max

    def weight(self, bearing_y: Triple, distance: float) -> float:
        """Return the weight of an edge, 0 to 1, of its bearing as the observer tells it.

        Args:
            distance: m, by the desired shape and the measured scale; 0 if it is not known.
        """
        near = 1.0
        if distance > 0.0:
            x = min(1.0, max(0.0, (self._range - distance) / (SHARE * self._range)))
            near = x * x * (3.0 - 2.0 * x)
        if self._half >= math.pi:
            return near
        return near * edge_weight(bearing_y, self._axis, self._half, MARGIN)
