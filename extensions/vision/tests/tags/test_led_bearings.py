"""Bearings to blinking LEDs: exact, of the right LED or of none; what is wrong is told."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from console.trackers.source import Sighting
from extensions.vision.simulated.rendered_camera import Pattern, RenderedCamera
from extensions.vision.tags.beacon_markers import BeaconMarkers, Mount, load_beacon_markers
from extensions.vision.tags.detector import Picture
from extensions.vision.tags.intrinsics import Intrinsics
from extensions.vision.tags.led_bearings import bearing_reader
from extensions.vision.tags.lights import MOST, Light, LightTracks, find_lights
from extensions.vision.tags.tag_bearings import BearingReader
from quadrotor.errors import MeasurementError
from quadrotor.records import Array
from quadrotor.rotations import rotation_exp

WIDTH, HEIGHT, RATE = 320, 240, 30.0
MATRIX = np.array([[220.0, 0.0, 161.0], [0.0, 220.0, 119.0], [0.0, 0.0, 1.0]])
DISTORTION = np.array([-0.2, 0.05, 0.001, -0.001, 0.0])
CAMERA = RenderedCamera(WIDTH, HEIGHT, MATRIX, DISTORTION, background=8.0, exposure=0.004, fine=2)
LENS = Intrinsics(WIDTH, HEIGHT, MATRIX, DISTORTION)
LEDS = {1: 2.0, 2: 3.5, 5: 5.0, 7: 9.0}
"""Blinks a second."""
PLACES = {1: (-0.4, 0.35, 0.0), 2: (0.4, 0.35, 0.0), 5: (0.4, -0.35, 0.0), 7: (-0.4, -0.35, 0.2)}
"""LEDs on the floor, m."""
MARKERS = BeaconMarkers(leds=LEDS, sigma=0.01, camera=Mount(position=(0.08, -0.02, -0.04)))
AXIS = np.linspace(-1.0, 1.0, 16)
DISC = np.hypot(AXIS, AXIS[:, None]) < 0.7


def a_pose(at: float) -> tuple[Array, Array, Array, Array]:
    """Return position_w, velocity_w, R_wb and turning_b of a vehicle in motion."""
    position = np.array([0.2 * np.sin(at), 0.1 * np.sin(2.0 * at), 1.7 + 0.1 * np.sin(at)])
    velocity = np.array([0.2 * np.cos(at), 0.2 * np.cos(2.0 * at), 0.1 * np.cos(at)])
    turn = np.array([0.05 * np.sin(2.0 * at), 0.05 * np.sin(3.0 * at), 0.2 * np.sin(at)])
    turning = np.array([0.1 * np.cos(2.0 * at), 0.15 * np.cos(3.0 * at), 0.2 * np.cos(at)])
    return position, velocity, rotation_exp(turn), turning


def picture(at: float, rates: dict[int, float], camera: RenderedCamera = CAMERA) -> Picture:
    """Return the picture at a time, s, of LEDs that blink at these rates."""
    position_w, velocity_w, R_wb, turning_b = a_pose(at)
    to_camera, lens_b = MARKERS.camera.axes_b.T, np.array(MARKERS.camera.position)
    patterns = []
    for number, rate in rates.items():
        from_body = R_wb.T @ (np.array(PLACES[number]) - position_w)
        is_dim = rate and (rate * at + 0.3 * number) % 1.0 < 0.5
        level = 90 if is_dim else 220
        patterns.append(
            Pattern(
                np.where(DISC, level, 0).astype(np.uint8),
                (0.05, 0.05),
                to_camera @ (from_body - lens_b),
                to_camera @ R_wb.T,
                to_camera @ (-np.cross(turning_b, from_body) - R_wb.T @ velocity_w),
                -to_camera @ turning_b,
            )
        )
    return camera.take(patterns, np.random.default_rng(round(1e3 * at)))


def off(seen: Sighting, at: float) -> Array:
    """Return the errors of bearings, deg."""
    position_w, _, R_wb, _ = a_pose(at)
    away = (np.array([PLACES[n] for n in seen.beacon_ids]) - position_w) @ R_wb
    away /= np.linalg.norm(away, axis=1)[:, None]
    errors: Array = np.degrees(np.linalg.norm(seen.bearings_b - away, axis=1))
    return errors


def pictures(
    rates: dict[int, float], count: int = 30, camera: RenderedCamera = CAMERA
) -> list[Picture]:
    return [picture(k / RATE, rates, camera) for k in range(count)]


def taken(reader: BearingReader, greys: list[Picture], rate: float = RATE) -> list[Sighting]:
    return [reader.take(grey, round(1e9 * k / rate), PLACES) for k, grey in enumerate(greys)]


@pytest.fixture(scope="module")
def usual() -> list[Picture]:
    """Return 1.5 s of pictures."""
    return pictures(LEDS, 44)


def test_bearings_are_exact_and_of_the_right_led_once_a_second_of_blinks_was_seen(
    usual: list[Picture],
) -> None:
    reader = bearing_reader(MARKERS, LENS)
    seen = taken(reader, usual)
    assert not any(one.beacon_ids for one in seen[:26])
    assert all(one.beacon_ids == [1, 2, 5, 7] for one in seen[31:])
    errors = np.concatenate([off(one, k / RATE) for k, one in enumerate(seen) if one.beacon_ids])
    # Without the offset of the lens they would be off by 3 deg.
    assert errors.max() < 0.1
    assert set(reader.tags) == set(LEDS)  # marked in the picture for people
    assert reader.misfit(seen[-1], PLACES) < 0.5


def test_fewer_than_four_leds_are_as_exact_with_the_vehicles_estimated_position(
    usual: list[Picture],
) -> None:
    reader = bearing_reader(MARKERS, LENS)
    four = taken(reader, usual[:35])[-1]
    two = {number: rate for number, rate in LEDS.items() if number < 5}
    at = 35 / RATE
    assert reader.take(picture(at, two), round(1e9 * at), PLACES).beacon_ids == []
    at, estimated_w = 36 / RATE, a_pose(36 / RATE)[0] + 0.1
    seen = reader.take(picture(at, two), round(1e9 * at), PLACES, estimated_w)
    assert seen.beacon_ids == [1, 2]
    assert four.sigma < seen.sigma
    assert off(seen, at).max() < np.degrees(seen.sigma)


def test_leds_that_are_not_in_the_layout_give_no_bearings(usual: list[Picture]) -> None:
    reader = bearing_reader(MARKERS, LENS)
    for k, grey in enumerate(usual[:30]):
        seen = reader.take(grey, round(1e9 * k / RATE), {2: PLACES[2]}, a_pose(k / RATE)[0])
    assert seen.beacon_ids == [2]
    assert set(reader.tags) == set(LEDS)  # seen, all the same


def test_a_light_at_the_edge_of_the_picture_is_not_used() -> None:
    grey = np.full((HEIGHT, WIDTH), 8, np.uint8)
    grey[100:104, -3:] = grey[50:54, 60:64] = 200
    [light] = find_lights(grey)
    np.testing.assert_allclose(light.pixel, (61.5, 51.5), atol=1e-9)


def test_lights_that_meet_are_followed_no_longer() -> None:
    tracks = LightTracks()

    def lights(*columns: float) -> list[Light]:
        return [Light(np.array([x, 50.0]), 900.0, False) for x in columns]

    for k in range(5):
        tracks.take(lights(10.0 + 4.0 * k, 50.0 - 4.0 * k), k / RATE)
    one, other = tracks.tracks
    tracks.take(lights(29.0, 31.0), 5 / RATE)
    assert one not in tracks.tracks
    assert other not in tracks.tracks
    assert len(tracks.tracks) == 2  # their blinks are counted again


def test_steady_lights_are_ignored_and_one_that_blinks_at_another_rate_is_told() -> None:
    reader = bearing_reader(MARKERS, LENS)
    seen = taken(reader, pictures({**LEDS, 7: 0.0}))
    assert (seen[-1].beacon_ids, set(reader.tags), reader.doubt) == ([], {1, 2, 5}, "")
    taken(reader := bearing_reader(MARKERS, LENS), pictures({**LEDS, 7: 6.5}))
    assert "a light blinks 6.5 times a second, and no LED of the file does" in reader.doubt
    assert set(reader.tags) == {1, 2, 5}


def test_pictures_that_cannot_be_used_are_told(usual: list[Picture]) -> None:
    reader = bearing_reader(MARKERS, LENS)
    with pytest.raises(MeasurementError, match="LED 1 is seen twice: cover its reflection"):
        taken(reader, pictures({**LEDS, 2: LEDS[1]}))
    with pytest.raises(
        MeasurementError, match=r"4 of 4 lights are saturated: shorten the exposure"
    ):
        taken(
            bearing_reader(MARKERS, LENS),
            pictures(LEDS, camera=replace(CAMERA, light=40.0, background=0.2)),
        )
    with pytest.raises(MeasurementError, match="LED 7 blinks 9 times a second, too fast for 15"):
        taken(bearing_reader(MARKERS, LENS), usual[::2], 0.5 * RATE)
    with pytest.raises(MeasurementError, match="the picture is white"):
        reader.take(np.full((HEIGHT, WIDTH), 250, np.uint8))
    with pytest.raises(MeasurementError, match="a picture of 240 x 320 pixels"):
        reader.take(np.zeros((WIDTH, HEIGHT), np.uint8))
    stars = np.zeros((HEIGHT, WIDTH), np.uint8)
    stars[::20, ::20] = stars[1::20, ::20] = stars[::20, 1::20] = 200
    with pytest.raises(MeasurementError, match=rf"165 lights are in the picture, allowed {MOST}"):
        find_lights(stars)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("[leds]\n1 = 3.0\n2 = 3.5", "LEDs 1 and 2 blink 3 and 3.5 times a second; set them at"),
        ("[leds]\n1 = 1.0", r"leds\.1 .* greater than or equal to 2"),
        ("size = 0.2\n[leds]\n1 = 3.0", "either size, .* or"),
    ],
)
def test_files_that_name_no_usable_leds_are_told(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "beacons.toml").write_text(text)
    with pytest.raises(MeasurementError, match=told):
        load_beacon_markers(tmp_path / "beacons.toml")
