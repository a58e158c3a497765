"""Beacons in the 3D view: nodes, rays, cones, the estimate's ghost, the map; bandwidth."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import websockets.sync.client

from bearing_sim.beacons import PAPER_BEACONS, PRESETS, Beacons
from bearing_sim.observability import FieldOfView, bound_map
from quadrotor.errors import OutOfBoundsError
from tests.support.clock import Clock
from vehicle_link.messages import decode, encode, header, new
from web.latest import Live
from web.view.beacons.marks import SEEN, UNSEEN
from web.view.beacons.scene import BeaconScene, BeaconView
from web.view.scene import RATE, Scene
from web.view.server import SECRET_HEADER, VIEW_HEADER, ViewServer

SIGMA = math.radians(1.5)
VOLUME = ((-3.0, 3.0), (-3.0, 3.0), (0.2, 3.0))
BUDGET = 60_000  # bytes a second and client


@pytest.fixture(scope="module")
def shared_server() -> Iterator[ViewServer]:
    made = ViewServer()
    yield made
    made.stop()


@pytest.fixture
def server(shared_server: ViewServer) -> ViewServer:
    shared_server.viser.scene.reset()
    return shared_server


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def live(clock: Clock) -> Live:
    return Live(decode, clock)


@pytest.fixture
def scene(server: ViewServer, live: Live) -> BeaconScene:
    return BeaconScene(server, live)


@pytest.fixture
def node(server: ViewServer) -> Callable[[str], Any]:
    return lambda name: server.viser.scene._handle_from_node_name[name]


def odometry(place: tuple[float, float, float], yaw: float = 0.0, stamp_ns: int = 0) -> bytes:
    turn = (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))
    pose = {"pose": {"position": place, "orientation": turn}}
    return encode(new("nav_msgs/Odometry", header=header(stamp_ns), pose=pose))


def bearings(
    place: tuple[float, float, float],
    beacons: Beacons = PAPER_BEACONS,
    yaw: float = 0.0,
    stamp_ns: int = 0,
    ids: tuple[int, ...] | None = None,
    sigma: float = SIGMA,
) -> bytes:
    """Return bearings without noise, from a level vehicle."""
    seen = beacons.ids.tolist() if ids is None else list(ids)
    rays = np.array([beacons.place(id) for id in seen]) - place
    unit = rays / np.linalg.norm(rays, axis=1)[:, None]
    c, s = math.cos(yaw), math.sin(yaw)
    in_body = unit @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    rows = [tuple(one) for one in in_body.tolist()]
    return encode(
        new(
            "quadlab_msgs/BearingArray",
            header=header(stamp_ns),
            beacon_ids=seen,
            bearings=rows,
            sigma=sigma,
        )
    )


def one_frame(place: tuple[float, float, float], covariance: Any) -> bytes:
    whole = np.full((6, 6), 7.0)
    whole[:3, :3] = covariance
    pose = {"position": place, "orientation": (0.0, 0.0, 0.0, 1.0)}
    return encode(
        new(
            "geometry_msgs/PoseWithCovarianceStamped",
            header=header(0),
            pose={"pose": pose, "covariance": whole.ravel().tolist()},
        )
    )


def comparison(**places: tuple[float, float, float]) -> bytes:
    results = [
        new(
            "quadlab_msgs/EstimatorResult",
            name=name.replace("__", ":"),
            initialized=place[2] > 0,
            pose={"position": place, "orientation": (0.0, 0.0, 0.0, 1.0)},
            position_covariance=(0.01 * np.eye(3)).ravel().tolist(),
        )
        for name, place in places.items()
    ]
    return encode(new("quadlab_msgs/EstimatorComparison", header=header(0), estimators=results))


def test_the_papers_beacons_stand_until_a_layout_is_known(scene: BeaconScene, node: Any) -> None:
    for k, position in enumerate(PAPER_BEACONS.positions_w):
        np.testing.assert_allclose(node(f"/beacons/{k}").position, position)
        assert node(f"/beacons/{k}/id").text == str(k + 1)
        assert node(f"/beacons/{k}/post").scale == (1.0, 1.0, 0.1)


def test_a_layout_reuses_the_nodes_that_are_there(
    scene: BeaconScene, node: Any, server: ViewServer
) -> None:
    first = [node(f"/beacons/{k}") for k in range(4)]
    scene.set_beacons(PRESETS["eight"], SIGMA)
    assert [node(f"/beacons/{k}") for k in range(4)] == first
    assert all(node(f"/beacons/{k}").visible for k in range(8))
    names = set(server.viser.scene._handle_from_node_name)
    scene.set_beacons(PRESETS["wall"], SIGMA)
    assert [node(f"/beacons/{k}").visible for k in range(8)] == [True] * 4 + [False] * 4
    np.testing.assert_allclose(node("/beacons/2").position, PRESETS["wall"].positions_w[2])
    scene.set_beacons(PRESETS["eight"], SIGMA)
    assert set(server.viser.scene._handle_from_node_name) == names, "no node made or removed"
    assert node("/beacons/7").visible


def test_rays_reach_the_beacons_from_the_true_pose_of_their_stamp(
    scene: BeaconScene, live: Live, node: Any
) -> None:
    at, later = (0.2, -0.3, 1.1), (0.5, -0.3, 1.1)
    live.put("state", odometry((9.0, 9.0, 9.0)))  # the estimate is used only without truth
    live.put("truth", odometry(at, yaw=0.7, stamp_ns=1_000_000_000))
    scene.update(0.0)
    live.put("truth", odometry(later, yaw=0.7, stamp_ns=1_030_000_000))
    halfway = (0.35, -0.3, 1.1)
    live.put("bearings", bearings(halfway, yaw=0.7, stamp_ns=1_015_000_000))
    scene.update(1.0)
    assert node("/rays").visible
    points = node("/rays").points
    np.testing.assert_allclose(points[:, 0], np.tile(halfway, (4, 1)), atol=1e-6)
    np.testing.assert_allclose(points[:, 1], PAPER_BEACONS.positions_w, atol=1e-6)


def test_a_ray_ends_beside_its_beacon_by_the_noise(
    scene: BeaconScene, live: Live, node: Any
) -> None:
    at = (0.0, 0.0, 1.0)
    live.put("truth", odometry(at))
    live.put("bearings", bearings(at, yaw=0.1))  # a sensor that reports a turned vehicle
    scene.update(0.0)
    ends = node("/rays").points[:, 1]
    off = np.linalg.norm(ends - PAPER_BEACONS.positions_w, axis=1)
    np.testing.assert_allclose(off, 2.0 * math.sin(0.05) * math.sqrt(2.0), rtol=1e-5)
    distance = np.linalg.norm(ends - at, axis=1)
    np.testing.assert_allclose(distance, math.sqrt(2.81), rtol=1e-6)


def test_without_truth_they_leave_the_vehicles_estimate(
    scene: BeaconScene, live: Live, node: Any
) -> None:
    at = (0.4, 0.1, 0.9)
    live.put("bearings", bearings(at))
    scene.update(0.0)
    assert not node("/rays").visible, "nobody says from where"
    live.put("state", odometry(at))
    scene.update(1.0)
    np.testing.assert_allclose(node("/rays").points[:, 0], np.tile(at, (4, 1)), atol=1e-6)


def test_cones_are_three_sigma_wide_at_the_beacon(
    scene: BeaconScene, live: Live, node: Any
) -> None:
    at = (0.3, 0.2, 1.2)
    live.put("truth", odometry(at))
    live.put("bearings", bearings(at, sigma=0.02))
    scene.update(0.0)
    cones = node("/cones")
    assert cones.visible
    assert cones.opacity <= 0.08
    np.testing.assert_allclose(cones.batched_positions, np.tile(at, (4, 1)), rtol=1e-6)
    for k, beacon in enumerate(PAPER_BEACONS.positions_w):
        distance = np.linalg.norm(beacon - at)
        wide, high, reach = cones.batched_scales[k].tolist()
        assert reach == pytest.approx(distance, rel=1e-6)
        assert wide == high == pytest.approx(distance * math.tan(0.06), rel=1e-6)
        w, x, y, z = cones.batched_wxyzs[k].astype(float).tolist()
        axis = (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y))
        np.testing.assert_allclose(axis, (beacon - at) / distance, atol=1e-6)


def test_a_beacon_not_seen_has_neither_and_turns_grey(
    scene: BeaconScene, live: Live, clock: Clock, node: Any
) -> None:
    at = (0.0, 0.0, 1.0)
    for now in (0.0, 0.4, 0.8):
        live.put("truth", odometry(at))
        live.put("bearings", bearings(at, ids=(1, 2, 4) if now else None))
        scene.update(now)
    assert node("/beacons/2/ball").color == UNSEEN
    assert node("/beacons/3/ball").color == SEEN
    points = node("/rays").points
    np.testing.assert_allclose(points[2, 1], PAPER_BEACONS.place(4), atol=1e-6)
    np.testing.assert_allclose(points[3, 0], points[3, 1])
    assert node("/cones").batched_scales[3].max() < 0.001
    clock.now += 5.0
    live.put("truth", odometry(at))
    scene.update(5.0)
    assert node("/beacons/3/ball").color == UNSEEN


def test_bearings_of_beacons_nobody_knows_are_left_out(
    scene: BeaconScene, live: Live, node: Any
) -> None:
    at, eight = (0.0, 0.0, 1.0), PRESETS["eight"]
    live.put("truth", odometry(at))
    live.put("bearings", bearings(at, eight))
    scene.update(0.0)  # the layout is still the paper's: four of eight ids are known
    assert len(node("/rays").points) == 4
    live.put("bearings", bearings(at, eight, ids=(7, 8)))
    scene.update(1.0)
    assert not node("/rays").visible
    scene.set_beacons(eight, SIGMA)
    scene.update(2.0)
    assert node("/rays").visible
    assert len(node("/rays").points) == len(node("/cones").batched_scales) == 8


@pytest.mark.parametrize(
    "broken",
    [
        {"bearings": [(0.0, 0.0, -1.0)]},  # fewer than ids
        {"bearings": [(math.nan, 0.0, -1.0)] * 4},
        {"beacon_ids": [], "bearings": []},
        {"place": (math.inf, 0.0, 1.0)},
    ],
    ids=str,
)
def test_a_frame_that_cannot_be_drawn_does_not_stop_the_view(
    scene: BeaconScene, live: Live, node: Any, broken: dict[str, Any]
) -> None:
    given = {"beacon_ids": [1, 2, 3, 4], "bearings": [(0.0, 0.0, -1.0)] * 4, **broken}
    live.put("truth", odometry(given.pop("place", (0.0, 0.0, 1.0))))
    live.put("bearings", encode(new("quadlab_msgs/BearingArray", header=header(0), **given)))
    scene.update(0.0)
    rays = node("/rays")
    assert not rays.visible or np.isfinite(rays.points).all()
    live.put("truth", odometry((0.0, 0.0, 1.0), stamp_ns=1_000_000))
    live.put("bearings", bearings((0.0, 0.0, 1.0), stamp_ns=1_000_000))
    scene.update(1.0)
    assert rays.visible
    assert np.isfinite(rays.points).all()


def test_what_is_stale_is_hidden_and_a_slow_sensor_is_not_stale(
    scene: BeaconScene, live: Live, clock: Clock, node: Any
) -> None:
    at = (0.0, 0.0, 1.0)

    def later(by: float) -> bool:
        live.put("bearings", bearings(at))
        live.put("bearing_pose", one_frame(at, 0.01 * np.eye(3)))
        clock.now += by
        live.put("truth", odometry(at))
        scene.update(clock.now)
        shown = {node(name).visible for name in ("/rays", "/cones", "/estimate")}
        assert len(shown) == 1
        return bool(shown.pop())

    assert later(0.1)
    assert not later(0.6)
    scene.set_beacons(PAPER_BEACONS, SIGMA, rate=1.0)
    assert later(1.5)
    assert not later(3.0)


def test_rays_and_cones_are_switched(scene: BeaconScene, live: Live, node: Any) -> None:
    at = (0.0, 0.0, 1.0)
    live.put("truth", odometry(at))
    live.put("bearings", bearings(at))
    for rays in (False, True):
        for cones in (False, True):
            scene.show(BeaconView(rays=rays, cones=cones))
            scene.update(0.0)
            assert node("/rays").visible == rays
            assert node("/cones").visible == cones
    assert scene.view == BeaconView()


def test_the_ellipsoids_axes_are_three_standard_deviations(
    scene: BeaconScene, live: Live, node: Any
) -> None:
    rng = np.random.default_rng(31)
    for _ in range(10):
        root = rng.normal(size=(3, 3)) * 0.1
        covariance = root @ root.T + 1e-4 * np.eye(3)
        live.put("bearing_pose", one_frame((0.5, 0.6, 0.7), covariance))
        scene.update(0.0)
        scene._due = 0.0
        surface = node("/estimate/covariance")
        assert surface.visible
        scale = np.array(surface.scale)
        expected = 3.0 * np.sqrt(np.linalg.eigvalsh(covariance))
        np.testing.assert_allclose(np.sort(scale), expected, rtol=1e-9)
        w, x, y, z = surface.wxyz
        R = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        np.testing.assert_allclose(R @ np.diag((scale / 3.0) ** 2) @ R.T, covariance, atol=1e-12)
        np.testing.assert_allclose(node("/estimate").position, (0.5, 0.6, 0.7))


@pytest.mark.parametrize(
    "covariance", [np.full((3, 3), math.nan), -np.eye(3), np.zeros((3, 3)), 100.0 * np.eye(3)]
)
def test_a_covariance_that_is_none_leaves_the_ghost_without_ellipsoid(
    scene: BeaconScene, live: Live, node: Any, covariance: Any
) -> None:
    live.put("bearing_pose", one_frame((0.5, 0.6, 0.7), covariance))
    scene.update(0.0)
    assert node("/estimate").visible
    assert not node("/estimate/covariance").visible


def test_the_ghost_is_the_estimate_that_was_chosen(
    scene: BeaconScene, live: Live, clock: Clock, node: Any
) -> None:
    live.put("bearing_pose", one_frame((1.0, 0.0, 1.0), 0.01 * np.eye(3)))
    live.put(
        "comparison",
        comparison(
            vehicle=(0.1, 0.0, 1.0),
            complementary__paper=(0.2, 0.0, 1.0),
            error_state=(0.0, 0.0, 0.0),
        ),
    )
    ghost = node("/estimate")
    expected = {"one frame": 1.0, "vehicle": 0.1, "complementary:paper": 0.2}
    for name, x in expected.items():
        scene.show(BeaconView(estimate=name))
        scene.update(0.0)
        assert ghost.visible
        assert ghost.position[0] == pytest.approx(x)
    for name in ("none", "error_state", "unknown"):  # the second is not yet initialized
        scene.show(BeaconView(estimate=name))
        scene.update(0.0)
        assert not ghost.visible
    scene.show(BeaconView(estimate="vehicle"))
    clock.now += 1.0
    scene.update(1.0)
    assert not ghost.visible, "stale"


@pytest.mark.parametrize("height", [-0.1, 20.1, math.nan, math.inf])
def test_a_map_nowhere_is_refused(height: float) -> None:
    with pytest.raises(OutOfBoundsError, match="0 to 20 m"):
        BeaconView(map_height=height)


def settled(scene: BeaconScene, until: Any, wanted: Callable[[], bool]) -> None:
    """Draw frames until a map is shown; their time runs fast."""
    frames = iter(range(1_000_000))

    def step() -> bool:
        scene.update(0.25 * next(frames))
        return wanted()

    until(step)


def test_the_map_shows_the_bound_over_the_flight_volume(
    scene: BeaconScene, node: Any, server: ViewServer, until: Any
) -> None:
    from web.view.beacons.bound_image import Scale, picture

    told: list[Any] = []
    scene.on_legend = lambda: told.append(scene.legend())
    scene.update(0.0)
    assert "/bound" not in server.viser.scene._handle_from_node_name
    assert scene.legend() is None
    scene.set_volume(VOLUME)
    scene.show(BeaconView(map=True, map_height=1.5))
    settled(scene, until, lambda: scene.legend() is not None)
    bound = bound_map(PAPER_BEACONS, SIGMA, *VOLUME[:2], 1.5).position
    image = node("/bound")
    assert image.visible
    assert (image.render_width, image.render_height) == (6.0, 6.0)
    np.testing.assert_allclose(image.position, (0.0, 0.0, 1.5))
    scale = Scale.of(bound)
    assert scale is not None
    np.testing.assert_array_equal(image.image, picture(bound, scale))
    assert told == [scene.legend()]

    moved = PAPER_BEACONS.moved(1, (2.0, 2.0, 0.1))
    scene.set_beacons(moved, SIGMA)
    expected = bound_map(moved, SIGMA, *VOLUME[:2], 1.5).position
    scale = Scale.of(expected)
    assert scale is not None
    settled(scene, until, lambda: np.array_equal(image.image, picture(expected, scale)))
    scene.show(BeaconView(map=False))
    settled(scene, until, lambda: not image.visible)
    assert scene.legend() is None


def test_where_nothing_is_determined_there_is_no_map(
    scene: BeaconScene, server: ViewServer, until: Any, node: Any
) -> None:
    scene.set_volume(VOLUME)
    scene.show(BeaconView(map=True))
    settled(scene, until, lambda: scene.legend() is not None)
    scene.set_beacons(PAPER_BEACONS, SIGMA, replace(FieldOfView(), lost=None))
    settled(scene, until, lambda: scene.legend() is None)
    assert not node("/bound").visible


def test_a_flight_on_bearings_stays_within_its_bandwidth(server: ViewServer) -> None:
    """Fly with everything except the map, at 30 Hz: 8 beacons, noise, a ghost with an ellipsoid."""
    live = Live(decode)
    scene = Scene(server, live)
    scene.set_volume(VOLUME)
    eight = PRESETS["eight"]
    scene.beacons.set_beacons(eight, SIGMA)
    rng = np.random.default_rng(5)
    received = 0
    quiet = threading.Event()

    with websockets.sync.client.connect(
        server.url,
        subprotocols=[websockets.Subprotocol(f"viser-v{server.version}")],
        additional_headers={SECRET_HEADER: server.secret, VIEW_HEADER: "a"},
        compression=None,
        max_size=None,
        proxy=None,
    ) as socket:

        def read() -> None:
            nonlocal received
            for frame in socket:
                received += len(frame)
                quiet.clear()

        def settle() -> None:
            for _ in range(100):
                quiet.set()
                time.sleep(0.2)
                if quiet.is_set():
                    return
            pytest.fail("the scene never came to rest")

        threading.Thread(target=read, daemon=True).start()
        settle()
        received, frames = 0, 90
        for k in range(frames):
            t, stamp = k / RATE, round(1e9 * k / RATE)
            at = (math.sin(0.785 * t), 0.5 * math.sin(1.57 * t), 1.0 + 0.2 * math.sin(0.785 * t))
            live.put("state", odometry(at, stamp_ns=stamp))
            live.put("truth", odometry((at[0] + 0.01, *at[1:]), stamp_ns=stamp))
            live.put("reference", encode(new("quadlab_msgs/Reference", position=at)))
            live.put("status", encode(new("quadlab_msgs/VehicleStatus", armed=True, airborne=True)))
            live.put(
                "actuators", encode(new("quadlab_msgs/Actuators", motor_references=[127.0] * 4))
            )
            live.put("bearings", bearings(at, eight, yaw=0.02 * rng.normal(), stamp_ns=stamp))
            root = 0.05 * rng.normal(size=(3, 3))
            live.put("bearing_pose", one_frame(at, root @ root.T + 1e-4 * np.eye(3)))
            scene.update(t)
            time.sleep(1.0 / RATE)  # viser sends windows of 1/60 s; this is the load, not a wait
        settle()
        rate = received * RATE / frames
    print(f"scene with beacons: {rate / 1e3:.1f} kB/s")
    assert 10_000 < rate < BUDGET
