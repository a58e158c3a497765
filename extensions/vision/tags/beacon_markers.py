"""The file of a camera on the vehicle, and of the tags or LEDs that are its beacons."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from extensions.vision.tags.detector import DEFAULT_FAMILY
from extensions.vision.tags.tag_layout import Size, Strict, Triple, read_tags
from quadrotor.records import MAX_BEACONS, Array
from quadrotor.rotations import quaternion_from_euler, quaternion_to_matrix

DOWN = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
"""R_bc of a camera that looks along the body's -z, with the top of its picture forward."""
APART = 1.0
"""Smallest difference of two LEDs' blinks a second, so that a second of pictures tells them."""
Blinks = Annotated[float, Field(ge=2.0, le=100.0)]
"""Blinks a second."""


class Mount(Strict):
    """A camera on the vehicle."""

    position: Triple = (0.0, 0.0, 0.0)
    turn: Triple = (0.0, 0.0, 0.0)

    @property
    def axes_b(self) -> Array:
        """Return R_bc: columns are the camera's x right, y down in the picture, z forward."""
        return np.asarray(
            quaternion_to_matrix(quaternion_from_euler(*np.radians(self.turn))) @ DOWN
        )


class BeaconMarkers(Strict):
    """The camera and either its tags or its LEDs, from a TOML file.

    Attributes:
        size: of the tags, m; None with LEDs.
        sizes: of those of another size.
        leds: blinks a second of each LED, between dim and bright; empty with tags.
        delay: s, from the middle of the exposure to the driver's stamp.
        sigma: deg, of errors that the pictures do not show: stamps, the camera's axes, places of
            the beacons.
    """

    size: Size | None = None
    sizes: dict[int, Size] = Field(default_factory=dict)
    family: str = DEFAULT_FAMILY
    leds: dict[int, Blinks] = Field(default_factory=dict, max_length=MAX_BEACONS)
    sigma: Annotated[float, Field(ge=0.01, le=20.0)] = 0.2
    delay: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    camera: Mount = Mount()

    @model_validator(mode="after")
    def _is_of_one_kind(self) -> BeaconMarkers:
        if (self.size is None) == (not self.leds):
            raise ValueError(
                "it needs either size, of the tags in m, or [leds] with the blinks a second of "
                "each, like 1 = 3.0"
            )
        by_rate = sorted(self.leds, key=self.leds.__getitem__)
        for one, other in pairwise(by_rate):
            if self.leds[other] - self.leds[one] < APART:
                raise ValueError(
                    f"LEDs {one} and {other} blink {self.leds[one]:g} and {self.leds[other]:g} "
                    f"times a second; set them at least {APART:g} apart"
                )
        return self


def load_beacon_markers(path: Path) -> BeaconMarkers:
    """Return the content of a file. Raises StorageError, MeasurementError."""
    return read_tags(path, BeaconMarkers)
