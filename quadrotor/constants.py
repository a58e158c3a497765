"""Constants and names of this laboratory, in a module without imports."""

from __future__ import annotations

GRAVITY = 9.81
"""m/s^2, along -z_W."""

MOTORS = ("front", "left", "rear", "right")
"""Order of the motors everywhere; numbered 1 to 4 in eq. 1."""

THRUST_PER_TURN = 0.11 * 1.2 * 0.254**4
"""N s^2: thrust of a propeller of 0.254 m (Sec. 2) divided by its squared speed in turns per
second, with the static thrust coefficient 0.11 of 10 x 4.5 inch propellers: J. Brandt, M. Selig,
"Propeller performance data at low Reynolds numbers", 2011."""
