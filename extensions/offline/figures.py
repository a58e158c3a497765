"""The figures of one estimator that is run again over a recorded flight, for programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from extensions.offline.lines import ESTIMATOR, plan_runs
from extensions.offline.measurements import MeasurementStore
from extensions.offline.report import run_row
from extensions.offline.run import replay
from extensions.offline.window import find_window, tracked_truth, with_attitude
from quadlab.recording.errors import Truth
from quadlab.recording.log import read_recording
from quadrotor.errors import LogFormatError


def replayed(log: Path, words: Sequence[str] = ()) -> dict[str, float]:
    """Run an estimator over the IMU and the measurements of a recorded flight; return its errors
    and consistency while airborne, by the names that `quadlab replay --json` has.

    Errors are against the recorded truth, without one against the tracker's poses.

    Args:
        words: settings as `quadlab replay --set` takes them; of several values of a name the last
            one counts. Without estimation.estimator it is the flight's own.

    Raises StorageError, LogFormatError, UsageError.
    """
    recording = read_recording(log)
    if len(recording.truth) > 1:
        truth = Truth(recording.truth_ns, recording.truth)
    elif len(with_attitude(recording)) > 1:
        truth = tracked_truth(recording)
    else:
        raise LogFormatError(f"{log} holds neither truth nor poses: nothing can be compared")
    chosen = [one.partition("=")[2] for one in words if one.startswith(f"{ESTIMATOR}=")]
    others = [one for one in words if not one.startswith(f"{ESTIMATOR}=")]
    (run,) = plan_runs(recording, chosen[-1:], (), others, None)
    window = find_window(recording, truth, None, None)
    done = replay(recording, run, MeasurementStore(recording, truth).of(run))
    row = run_row(recording, truth, window, run, done)
    if done.started_ns is None:
        raise LogFormatError(row.note)
    values = {name: value for name, value in row.values.items() if isinstance(value, float | int)}
    values.pop("processor_s_per_s", None)
    return {name: float(value) for name, value in values.items()}
