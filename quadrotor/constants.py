"""Constants of nature as this laboratory has them; for modules that need nothing else."""

from __future__ import annotations

GRAVITY = 9.81
"""m/s^2, along -z_W."""
