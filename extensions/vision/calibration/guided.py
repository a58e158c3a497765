"""The guided calibration of a camera's intrinsics, for the terminal and, as a job, for the page.

The functions import what they use, so that the page's server, which only names the job, stays
small.
"""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from extensions.vision.tags.camera_calibration import CameraCalibration
from extensions.vision.tags.charuco import Board
from vehicle_link.termination_signal import EndSignal

if TYPE_CHECKING:
    from extensions.vision.tags.board_guide import BoardGuide
    from extensions.vision.tags.detector import Picture

SIMULATED = "simulated"
"""Name of the simulated camera, which shows a simulated board."""


class Looked(NamedTuple):
    """A picture that the guide has handled."""

    taken_ns: int
    grey: Picture
    was_taken: bool


def guided(
    camera: int | Path | str, board: Board, guide: BoardGuide, pace: float = 0.0
) -> Iterator[Looked]:
    """Show a camera's pictures to the guide until it has enough, and yield each.

    Args:
        camera: a device's number, a video file, or SIMULATED.
        pace: s between two simulated pictures.

    Raises as `extensions.vision.tracker.camera.Pictures` and `BoardGuide.look` do.
    """
    from extensions.vision.calibration.simulated_board import SimulatedPictures
    from extensions.vision.tracker.camera import Pictures

    source = SimulatedPictures(board, guide, pace) if isinstance(camera, str) else Pictures(camera)
    with closing(source):
        for stamp_ns, received_ns, grey in source:
            taken_ns = received_ns if stamp_ns is None else stamp_ns
            yield Looked(taken_ns, grey, guide.look(grey, taken_ns))
            if guide.goal is None:
                return


def calibrate_guided(
    camera: int | str, board: Board, pace: float, report: Callable[[object], None]
) -> CameraCalibration:
    """Return a camera's intrinsics when the guide has enough, or at SIGTERM from what it has.

    A job (`vehicle_link.jobs`). Reports the guide's state, with `picture`, a JPEG in base 64.

    Raises as `guided` and `BoardGuide.result` do.
    """
    from extensions.vision.tags.board_guide import BoardGuide
    from extensions.vision.tags.detector import picture_with_corners
    from extensions.vision.tracker.camera_view import PERIOD_NS

    stopping, guide, shown_ns = EndSignal(), BoardGuide(board), -PERIOD_NS
    for taken_ns, grey, was_taken in guided(camera, board, guide, pace):
        if was_taken or taken_ns - shown_ns >= PERIOD_NS or taken_ns < shown_ns:
            shown_ns = taken_ns
            jpeg = picture_with_corners(grey, guide.corners, taken=was_taken)
            report({**guide.state(), "picture": base64.b64encode(jpeg).decode()})
        if stopping.wait(0.0):
            break
    return guide.result()
