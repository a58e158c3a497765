"""The tags on each body and their places, and how the camera's place in the world is known.

A TOML file. A tag's axes: x right and y up in its upright picture, z out of the paper.

    family = "APRILTAG_36h11"   # the default

    [bodies.quad1.3]            # tag 3
    size = 0.12                 # of the black square, m
    position = [0, 0, 0.04]     # of its centre, body axes, m
    turn = [0, 0, 90]           # of its axes in the body's: roll, pitch, yaw, degrees

    [world.10]                  # a tag with a known place, which locates the camera
    size = 0.3
    position = [1, 0, 0]
"""

from __future__ import annotations

import math
import tomllib
from pathlib import Path
from typing import Annotated, TypeVar

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError, model_validator

from extensions.vision.tags.detector import DEFAULT_FAMILY
from quadrotor.errors import MeasurementError, StorageError
from quadrotor.records import Array
from quadrotor.rotations import quaternion_from_euler, quaternion_to_matrix

Size = Annotated[float, Field(gt=0.0, le=10.0)]
"""Side of the black square, m."""
Triple = tuple[FiniteFloat, FiniteFloat, FiniteFloat]

ROUND = np.array([[-0.5, 0.5, 0.0], [0.5, 0.5, 0.0], [0.5, -0.5, 0.0], [-0.5, -0.5, 0.0]])
"""Corners of a tag of size 1, in the order of `TagDetector.detect`."""


class Strict(BaseModel):
    model_config = ConfigDict(extra="forbid")


Told = TypeVar("Told", bound=Strict)


class TagPlace(Strict):
    """A tag on a body, or in the world."""

    size: Size
    position: Triple
    turn: Triple = (0.0, 0.0, 0.0)

    @property
    def corners(self) -> Array:
        """Return the corners (4, 3), m."""
        R = quaternion_to_matrix(quaternion_from_euler(*np.radians(self.turn)))
        corners: Array = self.size * ROUND @ R.T + np.array(self.position)
        return corners


class CameraPlace(Strict):
    """A camera at a measured position.

    Attributes:
        roll: deg, by which its picture's x axis leans down from the level.
    """

    position: Triple
    looks_at: Triple
    roll: FiniteFloat = 0.0

    @classmethod
    def of(cls, position_w: Array, R_wc: Array) -> CameraPlace:
        """Return the place of a camera with these axes, which looks at a point 3 m away."""
        x, y, z = (round(float(one), 4) for one in position_w)
        u, v, w = (round(float(one), 4) for one in position_w + 3.0 * R_wc[:, 2])
        level = cls(position=(x, y, z), looks_at=(u, v, w))
        right, down, _ = level.axes_w.T @ R_wc[:, 0]
        return level.model_copy(update={"roll": round(math.degrees(math.atan2(down, right)), 3)})

    @model_validator(mode="after")
    def _looks_somewhere(self) -> CameraPlace:
        if self.position == self.looks_at:
            raise ValueError("the camera's target is its own position")
        return self

    @property
    def axes_w(self) -> Array:
        """Return R_wc: columns are the camera's x right, y down, z forward."""
        z = np.array(self.looks_at) - self.position
        z /= np.linalg.norm(z)
        ahead = np.array([0.0, 0.0, 1.0]) if abs(z[2]) < 0.999 else np.array([1.0, 0.0, 0.0])
        x = np.cross(z, ahead)
        x /= np.linalg.norm(x)
        y, roll = np.cross(z, x), math.radians(self.roll)
        x = math.cos(roll) * x + math.sin(roll) * y
        return np.column_stack([x, np.cross(z, x), z])

    @property
    def text(self) -> str:
        """Return the place as a value in a TOML file."""
        values = (f"{name} = {value}" for name, value in self.model_dump(mode="json").items())
        return f"{{{', '.join(values)}}}"


class TagLayout(Strict):
    """All tags of a laboratory, and the places of cameras that tags of the world do not determine.

    Attributes:
        camera: the place of the only camera. cameras: those of several, by name.
    """

    family: str = DEFAULT_FAMILY
    bodies: dict[str, dict[int, TagPlace]]
    world: dict[int, TagPlace] = {}
    camera: CameraPlace | None = None
    cameras: dict[str, CameraPlace] = {}

    @model_validator(mode="after")
    def _is_complete(self) -> TagLayout:
        numbers = [n for tags in (*self.bodies.values(), self.world) for n in tags]
        if twice := {n for n in numbers if numbers.count(n) > 1}:
            raise ValueError(f"tag {min(twice)} is in it twice; give each place its own tag")
        if not self.bodies or not all(self.bodies.values()):
            raise ValueError("a body needs a tag, like [bodies.quad1.3]")
        of_one = bool(self.world) + (self.camera is not None)
        if of_one > 1 or not (of_one or self.cameras) or (self.camera and self.cameras):
            raise ValueError(
                "it needs either tags with places in the world, like [world.10], or [camera] with "
                "position and looks_at (of several cameras, [cameras.NAME] for each)"
            )
        return self

    def place_of(self, camera: str, *, is_alone: bool = True) -> CameraPlace | None:
        """Return the measured place of a camera, by its name if there are several; None when tags
        of the world determine it. Raises MeasurementError when nothing does.
        """
        found = self.cameras.get(camera, self.camera if is_alone else None)
        if found is None and not self.world:
            raise MeasurementError(
                f"no place is given for camera {camera}: add [cameras.{camera}] with position and "
                "looks_at to the file of tags, or tags with places in the world"
            )
        return found


def load_tags(path: Path) -> TagLayout:
    """Return the layout in a file. Raises StorageError, MeasurementError."""
    return read_tags(path, TagLayout)


def read_tags(path: Path, kind: type[Told]) -> Told:
    """Return the content of a TOML file of tags. Raises StorageError, MeasurementError."""
    try:
        return kind.model_validate(tomllib.loads(path.read_text()))
    except OSError as error:
        raise StorageError(f"tags {path}: {error.strerror}; name a TOML file of tags") from None
    except ValidationError as error:
        first = error.errors()[0]
        where = "".join(f"{part}." for part in first["loc"])[:-1]
        raise MeasurementError(f"tags {path}: {where} {first['msg']}".replace("  ", " ")) from None
    except (ValueError, RecursionError) as error:  # invalid TOML, or not a text
        raise MeasurementError(f"tags {path}: {error}") from None


def name_of(camera: int | Path) -> str:
    """Return the name of a camera in messages and in the file of tags."""
    return camera.stem if isinstance(camera, Path) else str(camera)
