"""Comparison of estimators on the page: its feed, its cost, its signals."""

from __future__ import annotations

import json
import math
from typing import Any

import httpx
import pytest

from estimation import registry
from estimation.parameters import PRESETS as GAINS
from extensions.comparison.routes import RATE, as_json
from tests.support.live_signals import Received
from vehicle_link.messages import decode, encode, new
from web.signals.estimates import COMPARED


@pytest.fixture
def site(beacon_site: Any) -> Any:
    return beacon_site


def comparison(**fields: Any) -> Any:
    results = [
        new(
            "quadlab_msgs/EstimatorResult",
            name="vehicle",
            position_error=0.0123,
            position_rms_recent=0.021,
            position_max_recent=0.05,
            position_rms=0.031,
            position_max=0.2,
            attitude_rms_recent=0.01,
            initialized=True,
            converged=True,
            attitude_error=0.01,
            processor=math.nan,
            beacon_ids=[3, 1],
            residuals=[0.02, 0.04],
            position_covariance=[math.nan] * 9,
        ),
        new(
            "quadlab_msgs/EstimatorResult",
            name="mine",
            initialized=True,
            position_error=0.2,
            processor=0.025,
        ),
        new(
            "quadlab_msgs/EstimatorResult",
            name="complementary:paper",
            position_error=0.5,
            attitude_error=0.02,
            position_covariance=[4e-4, 9, 9, 9, 4e-4, 9, 9, 9, 1e-4],
        ),
    ]
    return new(
        "quadlab_msgs/EstimatorComparison",
        truth="truth",
        duration=75.25,
        sigma=0.02,
        position_bound=0.027,
        attitude_bound=math.nan,
        estimators=results,
        **fields,
    )


def test_the_feed_has_lengths_in_mm_angles_in_degrees_and_no_nan() -> None:
    got = as_json(decode(encode(comparison()), "quadlab_msgs/EstimatorComparison"))
    assert (got["truth"], got["duration"]) == ("truth", 75.25)
    assert got["sigma"] == pytest.approx(math.degrees(0.02), rel=1e-2)
    vehicle, mine, _ = got["estimators"]
    assert vehicle["figures"] == [12.3, 21.0, 50.0, pytest.approx(0.573), 31.0, 200.0, None]
    assert (mine["figures"][0], mine["figures"][-1]) == (200.0, 2.5)
    assert (vehicle["state"], mine["state"]) == ("", "settling")
    assert [id for id, _ in vehicle["residuals"]] == [3, 1]
    assert vehicle["residuals"][1][1] == pytest.approx(math.degrees(0.04), rel=1e-2)
    assert mine["residuals"] == []
    json.dumps(got, allow_nan=False)


def test_an_open_tab_costs_at_most_six_kilobytes_a_second() -> None:
    figures = ("error", "rms_recent", "max_recent", "rms", "max")
    one = {f"position_{name}": 0.123456 for name in figures} | {"attitude_rms_recent": 0.0123456}
    residuals = {"beacon_ids": [1, 2, 3, 4], "residuals": [0.0123456] * 4, "processor": 0.0123}
    results = [new("quadlab_msgs/EstimatorResult", name=n, **one, **residuals) for n in COMPARED]
    message = new("quadlab_msgs/EstimatorComparison", truth="truth", estimators=results)
    assert len(json.dumps(as_json(message), separators=(",", ":"))) * RATE <= 6_000


def test_the_feed_speaks_when_there_is_news(
    site: Any, operator: httpx.Client, station: Any
) -> None:
    with site.websocket("/comparison", site.cookie(operator)) as page:
        station.compare(("vehicle", "error_state"))
        while len(first := json.loads(page.recv(timeout=10.0))["estimators"]) != 2:
            pass  # of an earlier test
        assert [one["name"] for one in first] == ["vehicle", "error_state"]
        with pytest.raises(TimeoutError):
            page.recv(timeout=3.0 / RATE)
        station.compare(("vehicle",))
        assert len(json.loads(page.recv(timeout=10.0))["estimators"]) == 1


# ---------------------------------------------------------------------- signals
def test_signals_of_the_comparison() -> None:
    received = Received()
    received.put("comparison", comparison())
    now = received.newest()
    assert now["comparison.position_error.vehicle"] == pytest.approx(12.3)
    assert now["comparison.position_error.complementary:paper"] == pytest.approx(500.0)
    assert now["comparison.attitude_error.vehicle"] == pytest.approx(math.degrees(0.01))
    assert now["comparison.deviation.complementary:paper"] == pytest.approx(30.0)
    assert now["comparison.position_bound"] == pytest.approx(27.0)
    for absent in ("deviation.vehicle", "position_error.error_state", "attitude_bound"):
        assert math.isnan(now[f"comparison.{absent}"])


def test_signals_of_one_frame() -> None:
    received = Received()
    covariance = [0.0] * 36
    covariance[0], covariance[7], covariance[14], covariance[21] = 4e-4, 4e-4, 1e-4, 7.0
    pose = {"pose": {"position": (1.0, 2.0, 3.0)}, "covariance": covariance}
    received.put("bearing_pose", new("geometry_msgs/PoseWithCovarianceStamped", pose=pose))
    now = received.newest()
    assert [now[f"bearing_pose.position.{a}"] for a in "xyz"] == [1.0, 2.0, 3.0]
    assert now["bearing_pose.deviation"] == pytest.approx(30.0)


def test_everything_that_comes_along_has_signals() -> None:
    along = {"error_state", "complementary"}
    assert along <= set(registry.names())
    assert {"vehicle", *along, *(f"complementary:{name}" for name in GAINS)} == set(COMPARED)
