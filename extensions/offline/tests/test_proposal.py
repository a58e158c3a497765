"""The page's survey proposes a layout from a run, and none from runs without the measurements."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bearing_sim.beacons import PAPER_BEACONS, format_layout, parse_layout
from extensions.offline import survey
from extensions.offline.proposal import propose_layout
from extensions.offline.survey import Place, Survey
from quadlab.recording import log as replay_log
from quadlab.recording.log import Arrival, Recording
from quadlab.simulated.parameters import FlightParameters
from quadrotor.errors import MeasurementError
from quadrotor.records import IMU_SAMPLE, STATE, bearings_sample, pose_sample

PATH = Path("flight.mcap")
SECOND = 10**9


def recorded(monkeypatch: pytest.MonkeyPatch, poses: bool, bearings: bool) -> Recording:
    """Let a log be a recording with such measurements, and return it."""
    nothing, states = np.zeros(0, np.int64), np.zeros(0, STATE)
    imu = np.zeros(3, IMU_SAMPLE)
    imu["stamp_ns"] = np.arange(3) * SECOND
    pose = Arrival(2 * SECOND, pose_sample(SECOND, np.zeros(3), np.array([1.0, 0, 0, 0])))
    away_b = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0]])
    seen = Arrival(SECOND, bearings_sample(SECOND, np.arange(1, 5, dtype=np.int32), away_b, 0.01))
    made = Recording(
        PATH,
        "quad1",
        imu,
        nothing,
        states,
        nothing,
        states,
        poses=[pose] * poses,
        bearings=[seen] * bearings,
        sweeps=[],
        parameters=FlightParameters(),
    )
    monkeypatch.setattr(replay_log, "read_recording", lambda path: made)
    return made


def test_a_proposal_has_the_places_found_and_what_was_not_predicted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recorded(monkeypatch, poses=True, bearings=True)
    moved = np.array([0.01, -0.02, 0.0])
    given: list[Any] = []

    def found(recording: Recording, run: Any, arrivals: list[Arrival], tell: Any) -> Any:
        given.extend((run.estimator, run.source, [one.arrival_ns for one in arrivals]))
        tell(0.5)
        places = [Place(n, moved, np.zeros(3), np.full(3, 0.004)) for n in (1, 2, 3, 4)]
        return PAPER_BEACONS, Survey(places, 0.005, 0.001)

    monkeypatch.setattr(survey, "survey_beacons", found)
    told: list[float] = []
    proposal = propose_layout(PATH, told.append)
    assert given == ["error_state", "both", [SECOND, 2 * SECOND]]
    assert told == [0.5, 1.0]
    assert proposal.began == format_layout(parse_layout("paper"))
    assert parse_layout(proposal.layout).positions_w.tolist() == PAPER_BEACONS.positions_w.tolist()
    assert (proposal.before, proposal.after) == (0.005, 0.001)
    assert proposal.beacons[1].moved_w == moved.tolist()
    assert not math.isnan(proposal.beacons[0].deviation_w[0])


@pytest.mark.parametrize(
    ("poses", "bearings", "told"),
    [
        (True, False, "the run has no bearings, and"),
        (False, False, "no tracker's poses and no bearings"),
    ],
)
def test_a_run_without_its_measurements_is_refused(
    monkeypatch: pytest.MonkeyPatch, poses: bool, bearings: bool, told: str
) -> None:
    recorded(monkeypatch, poses, bearings)
    with pytest.raises(MeasurementError, match=told):
        propose_layout(PATH, lambda share: None)
