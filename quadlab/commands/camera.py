"""`quadlab camera`: determines a camera's intrinsics from pictures of a ChArUco board."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from quadlab.commands.option_types import File
from quadrotor.errors import UsageError

if TYPE_CHECKING:
    from estimation.tags.detector import Picture

PICTURES = 40
EVERY_NS = 500_000_000


@dataclass
class Camera:
    """Calibrate a camera with a ChArUco board (DICT_4X4_250)."""

    out: Path
    """file for the intrinsics, camera_info YAML"""
    square: float
    """side of the board's squares, m"""
    marker: float
    """side of the markers in them, m"""
    board: str = "7x5"
    """squares across and down"""
    device: int = 0
    """number of the camera, as in /dev/video0"""
    video: File = None
    """read this video file instead of a camera"""

    def run(self) -> int:
        from estimation.tags.camera_calibration import Board, calibrate_camera

        columns, times, rows = self.board.partition("x")
        if not (columns.isdecimal() and times and rows.isdecimal()):
            raise UsageError(f"--board {self.board}: write it as 7x5, squares across and down")
        if self.out.exists():
            raise UsageError(f"{self.out} exists already; give --out a new file")
        board = Board(int(columns), int(rows), self.square, self.marker)
        found = calibrate_camera(self._pictures(), board)
        found.intrinsics.save(self.out)
        K = found.intrinsics.matrix
        print(
            f"focal lengths {K[0, 0]:.1f} ± {found.focal_deviation:.1f} and {K[1, 1]:.1f} pixels, "
            f"residual {found.residual:.2f} pixels, {found.coverage:.0%} of the picture covered by "
            f"{found.pictures} pictures: {self.out}"
        )
        return 0

    def _pictures(self) -> list[Picture]:
        """Return a picture every half second; of a video file, until its end."""
        from console.trackers.camera import Pictures

        source = Pictures(self.device if self.video is None else self.video)
        taken: list[Picture] = []
        last_ns = 0
        with contextlib.suppress(UsageError):  # the file has ended
            for _, received_ns, grey in source:
                if received_ns - last_ns >= EVERY_NS:
                    taken.append(grey)
                    last_ns = received_ns
                    print(f"picture {len(taken)} of {PICTURES}", flush=True)
                if len(taken) == PICTURES:
                    break
        source.close()
        return taken
