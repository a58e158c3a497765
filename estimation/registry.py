"""Estimators by name: the two built-in ones, those of extensions, and any that is registered.

    from estimation.registry import register
    register("mine", MyEstimator)

makes "mine" a value of the parameters estimation.estimator and estimation.shadow. The factory is
called with the EstimationParameters and returns an `estimation.estimator.Estimator`.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from estimation import names as known
from estimation.estimator import Estimator, TakesReadings
from estimation.parameters import EstimationParameters
from quadrotor.errors import MeasurementError, QuadlabError, UnknownParameterError, UsageError
from quadrotor.records import (
    BEARINGS_SAMPLE,
    ESTIMATE,
    IMU_SAMPLE,
    NO_ATTITUDE,
    POSE_SAMPLE,
    READING_SAMPLE,
    new_state,
)
from quadrotor.similar_names import did_you_mean

Factory = Callable[[EstimationParameters], Estimator]


_ready: set[tuple[str, bool]] = set()
names = known.names


def register(name: str, factory: Factory) -> None:
    """Offer an estimator under `name`, before the parameter tree's store is created.

    Registering a name again replaces it.
    """
    known.registered[name] = factory
    _ready.difference_update({(name, False), (name, True)})
    known.offer(())


def create(name: str, parameters: EstimationParameters) -> Estimator:
    """Create an estimator.

    Raises UnknownParameterError, or UsageError if the code of an extension cannot be imported.
    """
    if name not in names():
        raise UnknownParameterError(
            f"no estimator is called {name!r}: {did_you_mean(name, names(), after=' ')}there are "
            f"{', '.join(names())}"
        )
    factory: Factory = known.registered.get(name) or known.offered()[name].load()
    return factory(parameters)


def ready(name: str, bearings: bool) -> bool:
    """Return whether `prepare` was called for the estimator, so that no call of it compiles
    anything.
    """
    return (name, bearings) in _ready


def prepare(name: str, bearings: bool) -> None:
    """Compile everything that estimator `name` may call, with bearings or with poses alone.

    This takes seconds when nothing is cached, milliseconds otherwise, and no time when repeated.
    Raises UnknownParameterError, or UsageError for code of an extension that cannot run.
    """
    if ready(name, bearings):
        return
    try:
        rehearse(create(name, EstimationParameters()), bearings)
    except QuadlabError:
        raise
    except Exception as error:
        if name in known.BUILT_IN:
            raise
        raise UsageError(
            f"the estimator {name} fails at rest: {type(error).__name__}: {error}; mend it"
        ) from error
    _ready.update({(name, bearings), (name, False)})


def rehearse(estimator: Estimator, bearings: bool) -> None:
    """Call every method of an estimator once, on a vehicle at rest 1 m above four beacons."""
    imu, pose = np.zeros(1, IMU_SAMPLE), np.zeros(1, POSE_SAMPLE)
    frame, estimate, state = np.zeros(1, BEARINGS_SAMPLE), np.zeros(1, ESTIMATE), new_state()
    imu["specific_force_b"], pose["quaternion_wb"] = (0.0, 0.0, 9.81), (1.0, 0.0, 0.0, 0.0)
    pose["position_w"] = (0.1, 0.2, 1.0)
    beacons = np.array([[1.0, 1.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [1.0, -1.0, 0.0]])
    away = beacons - pose["position_w"]
    frame["count"], frame["sigma"] = 4, 0.02
    frame["beacon_w"][0, :4] = beacons
    frame["bearing_b"][0, :4] = away / np.linalg.norm(away, axis=1)[:, None]
    for k in range(1, 21):
        imu["stamp_ns"] = k * 2_000_000
        estimator.predict(imu, 0.002, state)
        if k % 5 == 0:
            pose["stamp_ns"], frame["stamp_ns"] = k * 2_000_000, k * 2_000_000 - 3_000_000
            if bearings:
                estimator.correct_bearings(frame, estimate)
            estimator.correct(pose, estimate)
        estimator.report(estimate)
    if isinstance(estimator, TakesReadings):
        reading = np.zeros(1, READING_SAMPLE)
        reading["stamp_ns"], reading["quaternion_wb"], reading["sigma"] = 1, (1, 0, 0, 0), 1.0
        estimator.correct_reading(reading)
    estimator.reset()
    pose["quaternion_wb"] = NO_ATTITUDE
    with suppress(MeasurementError):  # some estimators need attitudes
        estimator.correct(pose, estimate)
    estimator.reset()
    if bearings:
        estimator.correct_bearings(frame, estimate)  # starts an estimator without a pose
