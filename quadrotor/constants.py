"""Constants and names of this laboratory, for modules that need nothing else."""

from __future__ import annotations

GRAVITY = 9.81
"""m/s^2, along -z_W."""

MOTORS = ("front", "left", "rear", "right")
"""Their order everywhere; 1 to 4 where they are counted (eq. 1)."""
