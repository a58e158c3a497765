"""Intrinsics from rendered pictures of a ChArUco board."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from bearing_sim.rendered_camera import Pattern
from estimation.tags.camera_calibration import BOARD_FAMILY, Board, calibrate_camera
from estimation.tags.detector import Picture, dictionary_of
from estimation.tags.intrinsics import load_intrinsics
from quadlab.commands import camera
from quadrotor.errors import MeasurementError, UsageError
from quadrotor.rotations import rotation_exp
from tests.estimation.tags.rendered import CAMERA, FACING, MATRIX

BOARD = Board(7, 5, 0.05, 0.037)


@pytest.fixture(scope="module")
def pictures() -> list[Picture]:
    printed = cv2.aruco.CharucoBoard((7, 5), 0.05, 0.037, dictionary_of(BOARD_FAMILY))
    picture = np.asarray(printed.generateImage((840, 600)), np.uint8)
    random, camera = np.random.default_rng(3), replace(CAMERA, fine=2)
    found = []
    for k in range(12):
        distance = random.uniform(0.35, 0.55)
        side = np.array([(-0.3, 0.0, 0.3)[k % 3], (-0.2, 0.2)[k % 2]])
        R_cp = FACING @ rotation_exp(random.uniform(-0.5, 0.5, 3))
        place = distance * np.array([*side, 1.0])
        found.append(camera.take([Pattern(picture, (0.35, 0.25), place, R_cp)], random))
    return found


def test_the_intrinsics_are_found_within_their_deviation(pictures: list[Picture]) -> None:
    found = calibrate_camera(pictures, BOARD)
    assert found.pictures == 12
    assert found.residual < 0.2
    assert found.coverage > 0.6
    assert abs(found.intrinsics.matrix[0, 0] - 600.0) < max(1.5, 4.0 * found.focal_deviation)
    np.testing.assert_allclose(found.intrinsics.matrix, MATRIX, atol=3.0)


def test_too_few_pictures_too_little_of_the_picture_and_wrong_boards_are_refused(
    pictures: list[Picture],
) -> None:
    with pytest.raises(MeasurementError, match="in 3 pictures, 8 are needed"):
        calibrate_camera(pictures[:3], BOARD)
    with pytest.raises(MeasurementError, match="% are needed"):
        calibrate_camera([pictures[0]] * 9, BOARD)
    with pytest.raises(MeasurementError, match="no ChArUco board"):
        calibrate_camera(pictures, replace(BOARD, marker=0.06))
    with pytest.raises(MeasurementError, match="several sizes"):
        calibrate_camera([pictures[0], pictures[1][:400]], BOARD)


def test_the_command_writes_what_it_found_and_no_file_twice(
    pictures: list[Picture], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    video, out = tmp_path / "board.avi", tmp_path / "camera.yaml"
    writer = cv2.VideoWriter(str(video), cv2.VideoWriter.fourcc(*"MJPG"), 30.0, (640, 480))
    for grey in pictures:
        writer.write(cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR))
    writer.release()
    monkeypatch.setattr(camera, "EVERY_NS", 1)
    command = camera.Camera(out, BOARD.square, BOARD.marker, "7x5", video=video)
    assert command.run() == 0
    assert load_intrinsics(out).matrix[0, 0] == pytest.approx(600.0, abs=3.0)
    with pytest.raises(UsageError, match="exists already"):
        command.run()
    with pytest.raises(UsageError, match="7by5"):
        replace(command, board="7by5").run()
