"""The survey of a recorded run for the page, as a job of the page's process."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from quadrotor.errors import MeasurementError
from web.beacons.survey import LayoutProposal, SurveyedBeacon


def propose_layout(log: Path, report: Callable[[float], None]) -> LayoutProposal:
    """Return the positions of a run's beacons, from its recorded poses and bearings.

    Raises LogFormatError, StorageError; MeasurementError when the flight does not determine them.
    """
    # Imported here to keep scipy and the estimators out of the page's own process.
    from bearing_sim.beacons import format_layout, parse_layout
    from extensions.offline.lines import plan_runs
    from extensions.offline.survey import survey_beacons
    from quadlab.recording.log import read_recording

    recording = read_recording(log)
    missing = [
        name
        for name, there in (("tracker's poses", recording.poses), ("bearings", recording.bearings))
        if not there
    ]
    if missing:
        raise MeasurementError(
            f"the run has no {' and no '.join(missing)}, and both say where beacons are: fly it on "
            "the tracker, with bearings switched on"
        )
    [run] = plan_runs(recording, ["error_state"], (), (), "both")
    arrivals = sorted([*recording.poses, *recording.bearings], key=lambda one: one.arrival_ns)
    beacons, found = survey_beacons(recording, run, arrivals, report)
    report(1.0)
    began = format_layout(parse_layout(run.parameters.beacons.layout))
    places = zip(beacons.positions_w.tolist(), found.places, strict=True)
    return LayoutProposal(
        began,
        [
            SurveyedBeacon(one.number, place, one.moved_w.tolist(), one.deviation_w.tolist())
            for place, one in places
        ],
        found.before,
        found.after,
    )
