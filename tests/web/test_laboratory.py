"""`quadlab.connect`: a script reads a laboratory, changes it, and downloads runs."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterator
from itertools import count, islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import quadlab
from benchmarks.logs.recorded_run import MadeRun, write_run
from quadlab import laboratory
from quadlab.laboratory import REACH, Laboratory
from quadrotor.errors import LinkError, RefusedError, UnreachableError, UsageError
from tests.waiting import free_port
from vehicle_link.messages import encode, new
from vehicle_link.telemetry import pack
from web.latest import TICKS

RUN = "20260131T093042Z_quad1"
KP = "gains.kp"


@pytest.fixture
def lab(site: Any, station: Any) -> Iterator[Laboratory]:
    file = site.data / "runs" / f"{RUN}.mcap"
    file.unlink()
    write_run(file, MadeRun(2.0))
    with quadlab.connect(f"{site.base}/?token={site.token}") as made:
        yield made


def test_it_is_signed_in_by_a_link_and_is_present_as_a_page_is(
    lab: Laboratory, site: Any, until: Any
) -> None:
    assert (lab.role, lab.label.split()[0]) == ("admin", "admin")
    until(lambda: lab.summary["pages"] == 1)
    with pytest.raises(RefusedError, match="not signed in at http://127"):
        quadlab.connect(site.base)
    with pytest.raises(RefusedError, match="not signed in"):
        quadlab.connect(f"{site.base}/?token=used")


def test_what_is_no_laboratory_says_so(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="cannot be read as a certificate"):
        quadlab.connect("https://127.0.0.1:1", authority=tmp_path / "missing.pem")
    with pytest.raises(UsageError, match="give http://HOST:PORT"):
        quadlab.connect("localhost:8080")
    with pytest.raises(UnreachableError, match="no page answers at http://127"):
        quadlab.connect(f"http://127.0.0.1:{free_port()}")


def test_parameters_are_read_and_changed_and_refusals_say_why(
    lab: Laboratory, station: Any, until: Any
) -> None:
    def known() -> bool:
        station.fly()
        return KP in lab.parameters

    until(known)
    before = lab.parameters[KP]
    assert lab.set({KP: 4.75}) == {KP: 4.75}
    assert lab.parameters[KP] == 4.75
    with pytest.raises(RefusedError, match=KP):
        lab.set({KP: 1e9})
    assert lab.parameters[KP] == 4.75
    lab.set({KP: before})


def test_commands_reach_the_station_in_its_name(lab: Laboratory, station: Any) -> None:
    lab.command("arm")
    lab.start("take_off", height=1.5)
    (arm, one), (start, two) = station.requests
    assert (arm, start, one.requester) == ("arm", "start_behavior", lab.label)
    assert two.name == "take_off"
    station.refusal = "the motors are off; arm the vehicle first"
    with pytest.raises(RefusedError, match="arm the vehicle first"):
        lab.start("take_off", height=1.5)


@pytest.fixture
def flies(site: Any, station: Any) -> Iterator[None]:
    """Let the vehicle send a packet of five ticks each 10 ms, and its battery each 50 ms."""
    ended = threading.Event()

    def send() -> None:
        stamp_ns = time.time_ns()
        for k in count():
            ticks = station.tick()
            ticks = np.repeat(ticks, 5)
            steps = np.arange(5 * k, 5 * k + 5)
            ticks["imu"]["stamp_ns"] = stamp_ns + 2_000_000 * steps
            ticks["state"]["position_w"][:, 2] = steps % 1024
            station._live.put(TICKS, pack(ticks, 5 * k), int(ticks["imu"]["stamp_ns"][-1]))
            if k % 5 == 0:
                battery = new("sensor_msgs/BatteryState", voltage=10.0 + 0.01 * k)
                at_ns = int(ticks["imu"]["stamp_ns"][0])
                station._live.put("battery", encode(battery), at_ns)
            if ended.wait(0.01):
                return

    sender = threading.Thread(target=send)
    sender.start()
    yield
    ended.set()
    sender.join()


def test_a_stream_has_every_sample_with_the_vehicles_stamp(lab: Laboratory, flies: None) -> None:
    assert "state.position.z" in lab.signals
    samples = list(islice(lab.stream("state.position.z", "battery.voltage"), 600))
    assert samples[0].keys() == {"time", "state.position.z", "battery.voltage"}
    steps = np.array([one["state.position.z"] for one in samples])
    assert set(np.diff(steps) % 1024) == {1.0}  # none is missing, none comes twice
    times = np.array([one["time"] for one in samples])
    np.testing.assert_allclose(np.diff(times), 0.002, atol=1e-6)
    # A line, as the voltage rises by 0.01 V in five ticks: interpolated between its samples.
    voltage = np.array([one["battery.voltage"] for one in samples])
    known = np.isfinite(voltage)
    np.testing.assert_allclose(np.diff(voltage[known]), 0.002, atol=1e-5)
    assert known.mean() > 0.9
    with pytest.raises(UsageError, match="unknown signal 'nonsense'"):
        next(lab.stream("nonsense"))
    with pytest.raises(UsageError, match="rate=0 of a stream"):
        lab.stream("state.position.z", rate=0)


def test_a_rate_yields_the_mean_of_the_samples_in_each_interval(
    lab: Laboratory, flies: None
) -> None:
    every = [{"time": 0.002 * k, "x": float(k)} for k in range(100)]
    assert [one["x"] for one in laboratory.thinned(every, 10.0)] == [24.5, 74.5]
    stream = lab.stream("state.position.z", rate=20.0)
    times = [one["time"] for one in islice(stream, 1, 6)]
    np.testing.assert_allclose(np.diff(times), 0.05, atol=1e-3)


def test_runs_are_listed_and_taken_home(lab: Laboratory, tmp_path: Path) -> None:
    assert RUN in [run["id"] for run in lab.runs]
    run = lab.open(RUN, tmp_path)
    assert run.path == tmp_path / f"{RUN}.mcap"
    assert run.duration == pytest.approx(2.0, abs=0.1)
    with pytest.raises(RefusedError, match="list them on the Runs page"):
        lab.open("20200101T000000Z_quad1", tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == [f"{RUN}.mcap"]


def test_an_experiment_is_waited_for_and_its_run_has_the_verdict(
    lab: Laboratory, station: Any
) -> None:
    def told(phase: str, **more: Any) -> None:
        fields = {"name": "hover", "phase": phase, "run_id": RUN, "requester": lab.label, **more}
        station.put("experiment_status", new("quadlab_msgs/ExperimentStatus", **fields))

    def flown() -> None:
        while not any(name == "experiment" for name, _ in station.requests):
            threading.Event().wait(0.01)
        told("flying")
        threading.Event().wait(1.0)  # the script polls twice a second
        figures = {"metric_names": ["position_rms_m", "judged_s"], "metric_values": [0.002, 9.0]}
        told("passed", verdict="passed", metric_limits=[0.005, math.nan], **figures)

    earlier = {"run_id": "20250101T000000Z_quad1", "verdict": "failed"}
    told("failed", **earlier)  # of the same name and person, but not this one
    flight = threading.Thread(target=flown)
    flight.start()
    run = lab.fly("hover", duration=9.0)
    flight.join()
    assert run.result is not None
    assert (run.result.verdict, run.result.limits) == ("passed", {"position_rms_m": 0.005})
    assert run.result.metrics == {"position_rms_m": 0.002, "judged_s": 9.0}
    assert run.path.stem == RUN


def test_the_verdict_of_an_earlier_experiment_is_not_taken_for_a_new_one(
    lab: Laboratory, station: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("quadlab.laboratory.STARTED", 0.5)
    fields = {"name": "hover", "run_id": RUN, "requester": lab.label, "phase": "passed"}
    status = new("quadlab_msgs/ExperimentStatus", **fields, verdict="passed")
    station.put("experiment_status", status)
    with pytest.raises(LinkError, match="hover has no verdict"):
        lab.fly("hover")


@pytest.mark.parametrize("age", [None, REACH + 1.0])
def test_a_station_that_falls_silent_during_an_experiment_is_an_error(
    age: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    flying = {"name": "hover", "requester": "anna", "phase": "flying", "run_id": RUN}
    ages = iter([None, 0.1, age])  # before the start, in flight, silent

    def answer(method: str, path: str, **more: Any) -> dict[str, Any]:
        if path != "/api/summary":
            return {}
        return {"experiment": flying, "age": {"experiment_status": next(ages)}}

    monkeypatch.setattr(laboratory, "RETRY", 0.0)
    monkeypatch.setattr(Laboratory, "_json", staticmethod(answer))
    lab = Laboratory.__new__(Laboratory)  # not signed in anywhere
    lab.label = "anna"
    with pytest.raises(LinkError, match="the station is silent; hover may still be flying"):
        lab.fly("hover")
