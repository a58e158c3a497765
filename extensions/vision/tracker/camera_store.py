"""The cameras of this computer, and the intrinsics that were accepted for each.

`<data>/cameras/camera0.yaml` has those of /dev/video0 in use; earlier ones are kept in
`<data>/cameras/earlier/`, named by the time at which they were replaced.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from console.atomic_file import replacing
from extensions.vision.tags.camera_calibration import CameraCalibration
from extensions.vision.tags.intrinsics import ABOUT, NEEDED, load_intrinsics, read_yaml
from quadrotor.errors import QuadlabError, StorageError

FOLDER, EARLIER = "cameras", "earlier"
DEVICES = Path("/sys/class/video4linux")


class CameraStore:
    """The intrinsics of the cameras in a data folder.

    Args:
        data: the data folder.
        devices: where Linux lists the cameras.
    """

    def __init__(self, data: Path, devices: Path = DEVICES) -> None:
        self._folder, self._devices = data / FOLDER, devices

    def path(self, camera: int | str) -> Path:
        """Return the file of the intrinsics in use, there or not."""
        name = f"camera{camera}" if isinstance(camera, int) else camera
        return self._folder / f"{name}.yaml"

    def devices(self) -> dict[int, str]:
        """Return the cameras that are plugged in: name by number. Nodes that carry no pictures are
        left out.
        """
        found = {}
        for node in self._devices.glob("video*"):
            number = node.name.removeprefix("video")
            if number.isdecimal() and _text(node / "index", "0") == "0":
                found[int(number)] = _text(node / "name", f"camera {number}")
        return dict(sorted(found.items()))

    def keep(
        self, camera: int | str, found: CameraCalibration, requester: str, now: float | None = None
    ) -> Path:
        """Put calibrated intrinsics in use, keep those before, and return the file. Raises
        StorageError.

        Args:
            requester: the person who accepted them.
            now: s since 1970.
        """
        now, path = time.time() if now is None else now, self.path(camera)
        about = {
            "date": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(now)),
            "requester": requester,
            "residual": round(found.residual, 3),
            "coverage": round(found.coverage, 3),
            "views": found.views,
            "focal_deviation": round(found.focal_deviation, 2),
        }
        try:
            earlier = self._folder / EARLIER
            earlier.mkdir(parents=True, exist_ok=True)
            with replacing(path) as new:
                found.intrinsics.save(new, about)
                if path.exists():
                    stamp = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime(now))
                    (earlier / f"{path.stem}_{stamp}.yaml").hardlink_to(path)
        except OSError as error:
            raise StorageError(
                f"{path}: {error.strerror}; nothing was changed: free some space, or give --data a "
                "folder that can be written"
            ) from None
        return path

    def history(self, camera: int | str) -> list[dict[str, Any]]:
        """Return the intrinsics of a camera, those in use first, then the newest; a file that
        cannot be read has a `problem`.
        """
        path = self.path(camera)
        earlier = sorted((self._folder / EARLIER).glob(f"{path.stem}_*.yaml"), reverse=True)
        return [_described(one) for one in (path, *earlier) if one.exists()]


def _described(path: Path) -> dict[str, object]:
    try:
        lens, about = load_intrinsics(path), read_yaml(path, NEEDED).get(ABOUT)
    except QuadlabError as error:
        return {"file": str(path), "problem": str(error)}
    return {
        "file": str(path),
        "problem": "",
        "width": lens.width,
        "height": lens.height,
        "focal_lengths": [lens.matrix[0, 0], lens.matrix[1, 1]],
        **(about if isinstance(about, Mapping) else {}),
    }


def _text(path: Path, default: str) -> str:
    try:
        return path.read_text().strip() or default
    except OSError:
        return default
