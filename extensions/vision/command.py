"""`quadlab camera`: determines a camera's intrinsics, guided, from views of a ChArUco board."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from quadlab.data_folder import open_data_folder
from quadlab.option_types import File, Flag, Folder
from quadrotor.errors import MeasurementError, UsageError, os_errors

if TYPE_CHECKING:
    from extensions.vision.tags.camera_calibration import CameraCalibration
    from extensions.vision.tags.charuco import Board


@dataclass
class Camera:
    """Calibrate a camera with a ChArUco board (DICT_4X4_250), which is moved as the lines say."""

    out: File = None
    """file for the intrinsics, camera_info YAML (default: where `quadlab tracker` looks for those
    of this camera, in the data folder)"""
    square: float = 0.035
    """side of the board's squares, m"""
    marker: float = 0.026
    """side of the markers in them, m"""
    board: str = "7x5"
    """squares across and down"""
    device: int = 0
    """number of the camera, as in /dev/video0"""
    video: File = None
    """read this video file instead of a camera; with --out"""
    simulated: Flag = False
    """use a simulated camera and board"""
    paper: File = None
    """write the board to this PDF, to be printed, and exit"""
    data: Folder = None
    """data folder"""

    def run(self) -> int:
        from extensions.vision.tags.charuco import Board

        columns, times, rows = self.board.partition("x")
        if not (columns.isdecimal() and times and rows.isdecimal()):
            raise UsageError(f"--board {self.board}: write it as 7x5, squares across and down")
        board = Board(int(columns), int(rows), self.square, self.marker)
        if self.out is not None and self.out.exists():
            raise UsageError(f"{self.out} exists already; give --out a new file")
        if self.paper is not None:
            return _print(board, self.paper)
        if self.video is not None and self.out is None:
            raise UsageError("--video needs --out FILE: a video is not a camera of this computer")
        data = None if self.out is not None else open_data_folder(self.data)
        found = self._found(board)
        if found.warnings:
            raise MeasurementError(found.warnings[0])
        if data is None:
            assert self.out is not None
            place = self.out
            found.intrinsics.save(place)
        else:
            from extensions.vision.tracker.camera_store import CameraStore

            place = CameraStore(data).keep(self._camera, found, "quadlab camera")
        across, down = found.focal_lengths
        print(
            f"focal lengths {across:.1f} ± {found.focal_deviation:.1f} and {down:.1f} pixels, "
            f"residual {found.residual:.2f} pixels, {found.coverage:.0%} of the picture covered by "
            f"{found.views} pictures: {place}"
        )
        return 0

    @property
    def _camera(self) -> int | str:
        from extensions.vision.calibration.guided import SIMULATED

        return SIMULATED if self.simulated else self.device

    def _found(self, board: Board) -> CameraCalibration:
        """Guide a person, and return the result when there is enough, or the video has ended."""
        from extensions.vision.calibration.guided import guided
        from extensions.vision.tags.board_guide import BoardGuide

        guide, printed = BoardGuide(board), set[str]()  # of lines since the last view
        try:
            for looked in guided(self._camera if self.video is None else self.video, board, guide):
                state = guide.state()
                line = guide.hint or state["instruction"]
                if looked.was_taken:
                    print(f"picture {state['views']} taken, {state['share']:.0%} done", flush=True)
                    printed.clear()
                if line and line not in printed:
                    print(f"  {line}", flush=True)
                    printed.add(line)
        except UsageError:  # the video has ended
            if self.video is None:
                raise
        return guide.result()


def _print(board: Board, file: Path) -> int:
    from extensions.vision.tags.board_print import board_pdf

    if file.exists():
        raise UsageError(f"{file} exists already; give --paper a new file")
    with os_errors(lambda why: f"{file}: {why}; name a file that can be written"):
        file.write_text(board_pdf(board), "latin-1")
    print(f"print {file} at 100 %, and glue it to something flat")
    return 0
