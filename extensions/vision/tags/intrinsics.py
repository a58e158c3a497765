"""The intrinsics of a camera, in the file format of ROS's camera_info.

Model: focal lengths, principal point and D. C. Brown, "Close-range camera calibration" (1971), with
OpenCV's coefficients k1, k2, p1, p2, k3. Pixel (0, 0) is the centre of the first one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from quadrotor.errors import MeasurementError, StorageError, os_errors
from quadrotor.records import Array

MODEL = "plumb_bob"
"""ROS's name of the model."""
ABOUT = "calibration"
"""Key below which a file says how the intrinsics were found."""
NEEDED = "calibrate the camera in Settings, or give a camera_info YAML file"


@dataclass(frozen=True, eq=False)
class Intrinsics:
    """A camera's lens and picture.

    Attributes:
        width, height: of the picture, pixels.
        matrix: (3, 3), pixels: [[fx, 0, cx], [0, fy, cy], [0, 0, 1]].
        distortion: (5,) k1, k2, p1, p2, k3.
    """

    width: int
    height: int
    matrix: Array
    distortion: Array

    def project(self, points_c: Array) -> Array:
        """Return the pixels (N, 2) of points (N, 3) in camera axes.

        OpenCV's projectPoints gives the same, but always with its Jacobian, in five times the time.
        """
        k1, k2, p1, p2, k3 = self.distortion.tolist()
        x, y = points_c[:, 0] / points_c[:, 2], points_c[:, 1] / points_c[:, 2]
        r2 = x * x + y * y
        radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3))
        u = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)
        v = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y
        (fx, _, cx), (_, fy, cy), _ = self.matrix.tolist()
        return np.column_stack([fx * u + cx, fy * v + cy])

    def save(self, path: Path, about: Mapping[str, object] | None = None) -> None:
        """Write the intrinsics to a file, and how they were found, which ROS's readers skip. Raises
        StorageError.
        """
        from ruamel.yaml import YAML

        told = {
            "image_width": self.width,
            "image_height": self.height,
            "camera_name": path.name.partition(".")[0],
            "camera_matrix": {"rows": 3, "cols": 3, "data": self.matrix.ravel().tolist()},
            "distortion_model": MODEL,
            "distortion_coefficients": {"rows": 1, "cols": 5, "data": self.distortion.tolist()},
            **({ABOUT: dict(about)} if about else {}),
        }
        with os_errors(lambda why: f"{path}: {why}; name a file that can be written"):
            YAML().dump(told, path)


def load_intrinsics(path: Path) -> Intrinsics:
    """Return the intrinsics in a file. Raises StorageError, MeasurementError."""
    told = read_yaml(path, NEEDED)
    try:
        model = told.get("distortion_model", MODEL)
        if model != MODEL:
            raise ValueError(f"distortion_model {model!r:.30}, not {MODEL}")
        width, height = int(told["image_width"]), int(told["image_height"])
        matrix = np.array(told["camera_matrix"]["data"], float).reshape(3, 3)
        coefficients = np.array(told["distortion_coefficients"]["data"], float).reshape(5)
        numbers = np.concatenate([matrix.ravel(), coefficients])
        if not (np.isfinite(numbers).all() and min(matrix[0, 0], matrix[1, 1]) > 1.0):
            raise ValueError("numbers not finite, or focal lengths of 1 pixel or less")
        if not (0 < matrix[0, 2] < width and 0 < matrix[1, 2] < height):
            raise ValueError("the principal point is outside the picture")
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise MeasurementError(f"intrinsics {path}: {error!s:.120}; {NEEDED}") from None
    return Intrinsics(width, height, matrix, coefficients)


def read_yaml(path: Path, needed: str) -> Any:
    """Return the content of a YAML file; `needed` ends the error messages. Raises StorageError,
    MeasurementError.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    try:
        return YAML(typ="safe").load(path)
    except OSError as error:
        raise StorageError(f"{path}: {error.strerror}; {needed}") from None
    except (YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise MeasurementError(
            f"{path} is not YAML: {str(error).splitlines()[0]:.80}; {needed}"
        ) from None
