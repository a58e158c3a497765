"""The service `experiment`: each answer has its reason, and retries are idempotent."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from console.experiment_running.file_check import Described, described
from console.experiments.catalogue import experiments, find
from console.experiments.client import Experiment
from console.experiments.user_file import errors_with_line
from quadrotor.errors import UsageError
from quadrotor.json_object import JsonObject
from quadrotor.parameters import ParameterStore
from vehicle_link.messages import new
from vehicle_link.messages.records import ExperimentRequest, Message
from vehicle_link.parameters.messages import from_parameters, to_descriptor
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.idempotent import Idempotent
from vehicle_link.transport.node import Node

if TYPE_CHECKING:
    from console.experiment_running.runner import ExperimentRunner
    from console.experiment_running.user_files import UserFiles

ANSWER = f"{SERVICES['experiment']}_Response"


class ExperimentService:
    """Serves `/<vehicle>/station/experiment` in its own thread."""

    def __init__(
        self, node: Node, vehicle: str, runner: ExperimentRunner, files: UserFiles
    ) -> None:
        self._vehicle = vehicle
        self._runner, self._files = runner, files
        self._lock = threading.Lock()
        node.serve("station/experiment", SERVICES["experiment"], Idempotent(self._answer))

    def _answer(self, request: ExperimentRequest) -> Message:
        with self._lock:
            return self._do(request)

    def _do(self, request: ExperimentRequest) -> Message:
        requester = request.requester or "someone"
        if request.action == "describe":
            return describe(self._vehicle, self._files.described())
        self._runner.permit("experiment", requester)
        if request.action == "start":
            self._runner.check_free()
            options = from_parameters(request.options)
            self._runner.start(self._prepared(request.name, options), requester)
        elif request.action == "finish":
            self._runner.finish(requester)
        elif request.action == "stop":
            self._runner.stop(requester)
        elif request.action == "confirm":
            question = str(from_parameters(request.options).get("question", ""))
            self._runner.confirm(question, requester)
        elif request.action == "accept":
            self._runner.accept(requester)
        elif request.action == "reject":
            self._runner.reject(requester)
        else:
            raise UsageError(
                f"unknown action {request.action!r}; allowed are start, finish, stop, confirm, "
                "accept, reject and describe"
            )
        return new(ANSWER, accepted=True)

    def _prepared(self, name: str, options: JsonObject) -> Experiment:
        """Return the experiment with these options. Raises QuadlabError with the reason."""
        own = None if name in experiments() else self._files.find(name)
        experiment = own or find(name, self._vehicle)
        if experiment.parameters is not None:
            ParameterStore(experiment.parameters).set(options)
        elif options:
            raise UsageError(f"{name} has no options; leave out {', '.join(options)}")
        with errors_with_line(experiment):
            experiment.check()
        return experiment


def describe(vehicle: str, own: Sequence[Described]) -> Message:
    """Return the experiments' names, a line about each, and the options of all as
    <name>.<option>.
    """
    built_in = [_described(name, vehicle) for name in experiments()]
    listed = [*built_in, *own]
    descriptors = [
        to_descriptor(replace(option, name=f"{one.name}.{option.name}"))
        for one in listed
        for option in one.options
    ]
    return new(
        ANSWER,
        accepted=True,
        names=[one.name for one in listed],
        descriptions=[one.description for one in listed],
        descriptors=descriptors,
        calibrations=[one.calibration for one in listed],
        problems=[one.problem for one in listed],
    )


def _described(name: str, vehicle: str) -> Described:
    """Describe an experiment, or say why it cannot run: the others are listed all the same."""
    try:
        found = described(find(name, vehicle))
        return replace(found, calibration=experiments()[name].offer.calibration)
    except UsageError as error:
        return Described(name, problem=str(error))
