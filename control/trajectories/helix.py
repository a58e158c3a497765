"""A circle that rises by the same height in every lap."""

from __future__ import annotations

from control.trajectories.circle import Circle, Nose, Side


class Helix(Circle):
    """Laps of a circle that climbs `rise` m per lap; at rest at both ends, C4.

    Args:
        start: (x, y, z, yaw) m and rad, the lower end; the upper one for rise < 0.
        rise: m per lap, of either sign.
        radius, nose, side, period, laps, ramp: as for `circle.Circle`.

    Raises ValueError for a ramp that does not fit.
    """

    def __init__(
        self,
        start: tuple[float, float, float, float],
        *,
        rise: float = 0.3,
        radius: float = 1.0,
        nose: Nose = "fixed",
        side: Side = "left",
        period: float = 8.0,
        laps: int = 3,
        ramp: float = 3.0,
    ) -> None:
        super().__init__(
            start,
            radius=radius,
            nose=nose,
            side=side,
            rise=rise,
            period=period,
            laps=laps,
            ramp=ramp,
        )
