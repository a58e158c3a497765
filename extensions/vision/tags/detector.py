"""Detection of AprilTag and ArUco markers in a grey picture, corners to a fraction of a pixel.

E. Olson, "AprilTag: a robust and flexible visual fiducial system" (2011); S. Garrido-Jurado et
al., "Automatic generation and detection of highly reliable fiducial markers under occlusion"
(2014). Both families are read by OpenCV's detector.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection
from typing import Any

import numpy as np
import numpy.typing as npt

from console.trackers.camera_figures import wrong_exposure
from extensions.vision.tags.corners import refine_corners
from extensions.vision.tags.intrinsics import Intrinsics
from quadrotor.errors import MeasurementError
from quadrotor.records import Array

Picture = npt.NDArray[np.uint8]

Tags = dict[int, Array]
"""Corners (4, 2), pixels, of each detected tag."""

DEFAULT_FAMILY = "APRILTAG_36h11"

READ_AT = 1920
"""Width in pixels up to which a picture is enlarged for detection, by a whole number: OpenCV's
detector needs about two pixels per cell, and a tag seen at 65 degrees has less than one."""
SHARPNESS = 2.0
"""Share of the detail removed by a Gaussian of 1 pixel that is added before detection."""
READER = {
    "adaptiveThreshConstant": 14,  # grey levels; sharpened edges are that much steeper
    # Of the enlarged picture: one finds what two find; a smaller one misses tags in the dark.
    "adaptiveThreshWinSizeMin": 23,
    "adaptiveThreshWinSizeMax": 23,
    "perspectiveRemovePixelPerCell": 8,
    "perspectiveRemoveIgnoredMarginPerCell": 0.33,
    "errorCorrectionRate": 1.0,  # all bits that the family can correct
}


class TagDetector:
    """Detects the tags of one family.

    Args:
        lens: of the camera.
        family: OpenCV's name of its dictionary without DICT_, such as APRILTAG_36h11, 4X4_50.

    Raises MeasurementError for an unknown family.
    """

    def __init__(self, lens: Intrinsics, family: str = DEFAULT_FAMILY) -> None:
        import cv2

        self._lens = lens
        self._dictionary: Any = dictionary_of(family)
        reader: Any = cv2.aruco.DetectorParameters()
        for name, value in READER.items():
            setattr(reader, name, value)
        self._detector: Any = cv2.aruco.ArucoDetector(self._dictionary, reader)
        self._scale = max(1, READ_AT // lens.width)

    def detect(self, grey: Picture) -> list[tuple[int, Array]]:
        """Return the tags in a picture: number and corners (4, 2), in pixels.

        The corners are in the order top left, top right, bottom right, bottom left of the upright
        tag. A tag whose print does not fit the picture is left out: its corners would be off by a
        pixel. Raises MeasurementError for a picture of another size than the lens's.
        """
        check_size(grey, self._lens)
        corners, numbers, _ = self._detector.detectMarkers(self._readable(grey))
        if numbers is None:
            return []
        found = []
        for number, places in zip(np.ravel(numbers).tolist(), corners, strict=True):
            start = (places.reshape(4, 2) + 0.5) / self._scale - 0.5
            refined = refine_corners(grey, start, self.picture(number), self._lens)
            if refined is not None:
                found.append((number, refined))
        return found

    def tags(self, grey: Picture) -> Tags:
        """Return the corners (4, 2), pixels, of each tag in a picture: the result of `detect`, by
        number.

        Raises MeasurementError as `detect` does, for a tag seen twice, and for a black or white
        picture.
        """
        found = self.detect(grey)
        times = Counter(number for number, _ in found)
        if twice := [number for number, count in times.items() if count > 1]:
            raise MeasurementError(
                f"tag {min(twice)} is seen twice: cover one, or its mirror image; each tag may be "
                "there once"
            )
        mean = float(grey.mean())
        if not found and (what := wrong_exposure(mean)):
            raise MeasurementError(
                f"the picture is {what} (mean grey level {mean:.0f} of 255): check the lens's "
                "cap, the light and the exposure"
            )
        return dict(found)

    def _readable(self, grey: Picture) -> Picture:
        import cv2

        blurred = cv2.GaussianBlur(grey, (0, 0), 1.0)
        sharp = cv2.addWeighted(grey, 1.0 + SHARPNESS, blurred, -SHARPNESS, 0.0)
        n = self._scale
        return np.asarray(cv2.resize(sharp, None, fx=n, fy=n, interpolation=cv2.INTER_CUBIC))

    def picture(self, number: int) -> Picture:
        """Return the tag as it is printed, one pixel per cell, with its white rim of one cell."""
        import cv2

        size = self._dictionary.markerSize + 2
        tag = cv2.aruco.generateImageMarker(self._dictionary, number, size)
        return np.pad(np.asarray(tag, np.uint8), 1, constant_values=255)


def check_size(grey: Picture, lens: Intrinsics) -> None:
    """Raise MeasurementError for a picture of another size than the lens's."""
    size, wanted = grey.shape[::-1], (lens.width, lens.height)
    if size != wanted:
        raise MeasurementError(
            f"a picture of {' x '.join(map(str, size))} pixels, but the intrinsics are of "
            f"{wanted[0]} x {wanted[1]}: set the camera to that size, or calibrate it in Settings"
        )


def dictionary_of(family: str) -> Any:
    """Return OpenCV's dictionary. Raises MeasurementError for an unknown family."""
    import cv2

    number = getattr(cv2.aruco, f"DICT_{family}", None)
    if number is None:
        there = sorted({n[5:] for n in dir(cv2.aruco) if n.startswith("DICT_") and "H" not in n})
        raise MeasurementError(f"no tag family {family!r:.40}; there are {', '.join(there)}")
    return cv2.aruco.getPredefinedDictionary(number)


WIDEST = 640
"""Width in pixels above which a picture is reduced."""
QUALITY = 75
"""JPEG quality in percent: a rendered picture of 640 x 480 pixels has 14 kB."""
USED, UNUSED, SHADE = (120, 220, 60), (40, 170, 255), (20, 20, 20)  # blue, green, red


def marked_picture(grey: Picture, tags: Tags, used: Collection[int]) -> bytes:
    """Return a JPEG of the picture with outline, first corner and number of each tag: green if the
    tag is one of `used`, amber if it is unknown.

    The marks are drawn into the picture instead of being sent next to it, so that the page, the
    log, Foxglove and the replay all show the same, and the marks always belong to their picture.

    Raises MeasurementError when OpenCV cannot encode it.
    """
    import cv2

    picture, scale = _shown(grey)
    for number, corners in sorted(tags.items()):
        colour = USED if number in used else UNUSED
        outline = np.round((corners + 0.5) * scale - 0.5).astype(np.int32)
        cv2.polylines(picture, [outline], True, colour, 2, cv2.LINE_AA)
        cv2.circle(picture, outline[0].tolist(), 4, colour, -1, cv2.LINE_AA)
        right, middle = outline[:, 0].max(), outline[:, 1].mean()
        place = (int(right) + 5, int(middle) + 5)
        for shade, width in ((SHADE, 5), (colour, 2)):
            font = cv2.FONT_HERSHEY_SIMPLEX
            cv2.putText(
                picture, str(number), place, font, 0.8, shade, thickness=width, lineType=cv2.LINE_AA
            )
    return _jpeg(picture)


def picture_with_corners(grey: Picture, corners: Array, *, taken: bool) -> bytes:
    """Return a JPEG of the picture with the corners (N, 2) of a board, pixels: green if the picture
    was taken for the calibration. Raises MeasurementError when OpenCV cannot encode it.
    """
    import cv2

    picture, scale = _shown(grey)
    for corner in np.round((corners + 0.5) * scale - 0.5).astype(np.int32).tolist():
        cv2.circle(picture, corner, 4, SHADE, -1, cv2.LINE_AA)
        cv2.circle(picture, corner, 3, USED if taken else UNUSED, -1, cv2.LINE_AA)
    return _jpeg(picture)


def _shown(grey: Picture) -> tuple[Picture, float]:
    """Return a picture to draw on in colours, reduced to WIDEST, and its scale."""
    import cv2

    scale = min(1.0, WIDEST / grey.shape[1])
    if scale < 1.0:
        grey = np.asarray(
            cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8
        )
    return np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR), np.uint8), scale


def _jpeg(picture: Picture) -> bytes:
    import cv2

    done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
    if not done:
        raise MeasurementError(f"a picture of {picture.shape} cannot be made a JPEG")
    return bytes(data.tobytes())
