"""The services the vehicle offers on the link: commands, parameters, time, name."""

from __future__ import annotations

ROLE = "vehicle"
