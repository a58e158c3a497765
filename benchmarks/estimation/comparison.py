"""Estimators compared at the station: the share of a core that each needs, and their sum."""

from __future__ import annotations

import statistics
import time

import numpy as np
from scipy.spatial.transform import Rotation

from bearing_sim.beacons import PAPER_BEACONS
from bearing_sim.emulator import BearingMeasurement
from benchmarks.estimation.flights import FRAMES, RATE, SIGMA, Flight, flight
from benchmarks.harness import Report, Row, Size, Target
from estimation import registry
from estimation.parameters import PRESETS, EstimationParameters
from extensions.comparison.comparison import VEHICLE, EstimatorComparison
from extensions.comparison.parameters import parse_estimators
from extensions.comparison.results import Result, message_of
from quadrotor.records import TICK, Record
from vehicle_link.messages import encode
from vehicle_link.telemetry import SAMPLES_A_PACKET, pack, unpack

WORDS = "error_state complementary complementary:paper"
LIMIT = 0.03
"""Limit of each estimator, as a share of a core."""
TOLD_EVERY = 10  # packets
SEED = 7


def run(size: Size = Size.FULL) -> Report:
    """Run a flight with noise and biases through the comparison, as in the station's process."""
    duration, rounds = size.of((30.0, 7), (5.0, 3), (2.0, 1))
    flown = flight(SEED, duration)
    payloads, frames = _telemetry(flown), _frames(flown)
    report = Report(
        "comparison",
        "Estimators compared at the station: processor",
        [
            f"IMU {RATE:.0f} Hz in packets of {SAMPLES_A_PACKET}, four bearings {FRAMES:.0f} Hz, "
            f"truth 100 Hz, reports 10 Hz; {duration:.0f} s of flight, {rounds} rounds",
            "processor time of the thread over the flight's time; medians of the rounds",
            "own: the vehicle's estimate alone, decoding and encoding included",
            "accuracy: rms over the last 10 s against the truth, bearings only",
        ],
    )
    shares: dict[str, list[float]] = {}
    whole: dict[str, list[float]] = {"own": [], "all": []}
    results: list[Result] = []
    for _ in range(rounds):
        spent, _ = _fly("", payloads, frames, flown)
        whole["own"].append(spent / duration)
        spent, results = _fly(WORDS, payloads, frames, flown)
        whole["all"].append(spent / duration)
        for one in results:
            shares.setdefault(one.name, []).append(one.processor)
    for one in results:
        figures: dict[str, float | str] = {}
        if one.name != VEHICLE:
            figures["% of a core"] = 100.0 * statistics.median(shares[one.name])
            figures["range"] = (
                f"{100 * min(shares[one.name]):.2f}–{100 * max(shares[one.name]):.2f}"
            )
            figures["position, mm rms"] = 1e3 * one.recent.position_rms
            figures["attitude, ° rms"] = float(np.degrees(one.recent.attitude_rms))
            report.rows.append(Row(one.name, figures))
            report.targets.append(
                Target(f"{one.name}, share of a core", statistics.median(shares[one.name]), LIMIT)
            )
    others = len(results) - 1
    each = statistics.median(
        (a - b) / others for a, b in zip(whole["all"], whole["own"], strict=True)
    )
    report.targets.append(Target("what one more adds to the whole thread", each, LIMIT))
    for name, label in (("own", "own alone, whole thread"), ("all", "with all, whole thread")):
        report.rows.append(Row(label, {"% of a core": 100.0 * statistics.median(whole[name])}))
    return report


def _fly(
    words: str, payloads: list[bytes], frames: list[BearingMeasurement], flown: Flight
) -> tuple[float, list[Result]]:
    """Return processor time (s) and the last results."""
    comparison = EstimatorComparison(timer=time.thread_time)
    choices = parse_estimators(words)
    comparison.choose([one.word for one in choices])
    for word, name, preset in choices:
        registry.prepare(name, bearings=True)
        parameters = EstimationParameters.model_validate(PRESETS.get(preset, {}))
        comparison.start(word, registry.create(name, parameters))
    true = np.roll(Rotation.from_matrix(flown.R_wb[::SAMPLES_A_PACKET]).as_quat(), 1, axis=1)
    waiting, told = list(reversed(frames)), None
    began = time.thread_time()
    for k, payload in enumerate(payloads):
        stamp_ns = _stamp(k * SAMPLES_A_PACKET)
        comparison.truth(stamp_ns, flown.position_w[k * SAMPLES_A_PACKET], true[k])
        while waiting and waiting[-1].stamp_ns <= stamp_ns:
            comparison.bearings(waiting.pop(), PAPER_BEACONS)
        comparison.ticks(unpack(payload)[1])
        if k % TOLD_EVERY == TOLD_EVERY - 1 and (report := comparison.report()) is not None:
            told = report
            encode(message_of(report))
    assert told is not None
    return time.thread_time() - began, list(told.results)


def _stamp(k: int) -> int:
    return 1_000_000_000 + round(1e9 * k / RATE)


def _telemetry(flown: Flight) -> list[bytes]:
    """Return telemetry packets in which the vehicle's own estimate is the truth."""
    ticks: Record = np.zeros(len(flown.t), TICK)
    ticks["imu"]["stamp_ns"] = [_stamp(k) for k in range(len(ticks))]
    ticks["imu"]["angular_velocity_b"] = flown.sample[:, :3]
    ticks["imu"]["specific_force_b"] = flown.sample[:, 3:]
    ticks["state"]["position_w"], ticks["state"]["velocity_w"] = flown.position_w, flown.velocity_w
    quaternions = Rotation.from_matrix(flown.R_wb).as_quat()
    ticks["state"]["quaternion_wb"] = np.roll(quaternions, 1, axis=1)
    ticks["state"]["angular_velocity_b"] = flown.rate_b
    whole = len(ticks) // SAMPLES_A_PACKET * SAMPLES_A_PACKET
    return [pack(ticks[k : k + SAMPLES_A_PACKET], k) for k in range(0, whole, SAMPLES_A_PACKET)]


def _frames(flown: Flight) -> list[BearingMeasurement]:
    return [
        BearingMeasurement(
            1_000_000_000 + round(1e9 * one.t), PAPER_BEACONS.ids, one.bearings_b, float(SIGMA)
        )
        for one in flown.frames
    ]
