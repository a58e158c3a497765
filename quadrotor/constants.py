"""Constants and names of this laboratory, for modules that need nothing else."""

from __future__ import annotations

GRAVITY = 9.81
"""m/s^2, along -z_W."""

MOTORS = ("front", "left", "rear", "right")
"""Their order everywhere; 1 to 4 where they are counted (eq. 1)."""

THRUST_PER_TURN = 0.11 * 1.2 * 0.254**4
"""N s^2: thrust of a propeller of 0.254 m (Sec. 2) over the square of its turns a second, with the
static thrust coefficient 0.11 of 10 x 4.5 inch propellers: J. Brandt, M. Selig, "Propeller
performance data at low Reynolds numbers", 2011."""
