"""The work of the process that compares estimators: batches of the station's messages come in, ten
results a second and lines for the operator go out.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from typing import Any

from bearing_sim.beacons import PAPER_BEACONS
from bearing_sim.emulator import BearingMeasurement
from extensions.comparison.comparison import EstimatorComparison
from extensions.comparison.kernels import CompiledEstimators
from extensions.comparison.parameters import EstimatorChoice, parse_estimators
from extensions.comparison.results import message_of
from quadrotor.errors import OutOfBoundsError
from vehicle_link.messages import encode
from vehicle_link.telemetry import unpack

Batch = tuple[str, Sequence[tuple[Any, ...]]]
"""The text of the parameter, and (kind, its arguments) in the order of arrival."""


class ComparisonWorker:
    """Processes batches; reads no clock.

    Args:
        publish: called with an encoded quadlab_msgs/EstimatorComparison and its stamp, ns.
        say: called with a line for the operator.
        log: called with text for the log.
    """

    def __init__(
        self,
        publish: Callable[[bytes, int], None],
        say: Callable[[str], None],
        log: Callable[[str], None] = print,
    ) -> None:
        self._publish, self._say, self._log = publish, say, log
        self._comparison = EstimatorComparison(say)
        self._kernels = CompiledEstimators(say)
        self._text = ""
        self._choices: tuple[EstimatorChoice, ...] = ()
        self._missing: list[EstimatorChoice] = []
        self._defect = ""

    def process(self, batch: Batch) -> None:
        """Process a batch. A defect in what is only displayed ends nothing and is reported once."""
        text, items = batch
        for act in (
            lambda: self._follow(text),
            *(lambda one=one: self._feed(*one) for one in items),
            self._publish_report,
        ):
            try:
                act()
            except Exception as error:
                self._log(traceback.format_exc())
                if self._defect != repr(error):
                    self._defect = repr(error)
                    self._say(f"a defect in the comparison of estimators, see the log: {error!r}")

    def close(self) -> None:
        self._kernels.close()

    def _feed(self, what: str, *arguments: Any) -> None:
        if what == "telemetry":
            self._comparison.ticks(unpack(arguments[0])[1])
        elif what == "bearings":
            frame: BearingMeasurement = arguments[0]
            self._comparison.bearings(frame, frame.beacons or PAPER_BEACONS)
        else:
            getattr(self._comparison, what)(*arguments)  # truth, tracker, status

    def _follow(self, text: str) -> None:
        if text != self._text:
            self._text = text
            try:
                choices = parse_estimators(text)
            except OutOfBoundsError as error:  # registered only in the station's process
                self._say(f"not compared: {error}")
                return
            waiting = {*self._missing, *(set(choices) - set(self._choices))}
            self._missing = [one for one in choices if one in waiting]
            self._choices = choices
            self._comparison.choose([one.word for one in choices])
        if self._missing:
            self._missing = [one for one in self._missing if not self._started(one)]

    def _started(self, choice: EstimatorChoice) -> bool:
        if not self._kernels.ready(choice.name):
            return False
        from estimation import registry
        from estimation.parameters import PRESETS, EstimationParameters

        parameters = EstimationParameters.model_validate(PRESETS.get(choice.preset, {}))
        self._comparison.start(choice.word, registry.create(choice.name, parameters))
        return True

    def _publish_report(self) -> None:
        report = self._comparison.report()
        if report is not None:
            self._publish(encode(message_of(report)), report.stamp_ns)
