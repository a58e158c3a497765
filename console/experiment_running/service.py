"""The service `experiment`: words in, a reasoned answer out; a repeated one has one effect."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import Any, Protocol

from console.experiments.catalogue import EXPERIMENTS, find
from console.experiments.client import Experiment
from quadrotor.errors import QuadlabError, UsageError
from quadrotor.parameters import ParameterStore
from vehicle_link.idempotent import Idempotent
from vehicle_link.messages import new
from vehicle_link.node import Node
from vehicle_link.parameter_messages import from_parameters, to_descriptor
from vehicle_link.topics import SERVICES

ANSWER = f"{SERVICES['experiment']}_Response"


class Runner(Protocol):
    """Each raises RefusedError with the reason."""

    def permit(self, command: str, requester: str) -> None: ...

    def start(self, experiment: Experiment, requester: str) -> None: ...

    def finish(self, requester: str) -> None: ...

    def stop(self, requester: str) -> None: ...


class ExperimentService:
    """Serves `/<vehicle>/station/experiment` on its own thread."""

    def __init__(self, node: Node, vehicle: str, runner: Runner) -> None:
        self._vehicle = vehicle
        self._runner = runner
        self._lock = threading.Lock()
        node.serve("station/experiment", SERVICES["experiment"], Idempotent(self._answer))

    def _answer(self, request: Any) -> Any:
        try:
            with self._lock:
                return self._do(request)
        except QuadlabError as error:
            return new(ANSWER, accepted=False, reason=str(error))

    def _do(self, request: Any) -> Any:
        requester = request.requester or "somebody"
        if request.action == "describe":
            return describe(self._vehicle)
        self._runner.permit("experiment", requester)
        if request.action == "start":
            options = from_parameters(request.options)
            self._runner.start(prepared(request.name, options, self._vehicle), requester)
        elif request.action == "finish":
            self._runner.finish(requester)
        elif request.action == "stop":
            self._runner.stop(requester)
        else:
            raise UsageError(
                f"{request.action!r} is no action; there are start, finish, stop and describe"
            )
        return new(ANSWER, accepted=True)


def prepared(name: str, options: dict[str, Any], vehicle: str) -> Experiment:
    """The experiment with these options. Raises UsageError, ParameterError or StorageError."""
    experiment = find(name, vehicle)
    if experiment.parameters is not None:
        ParameterStore(experiment.parameters).set(options)
    elif options:
        raise UsageError(f"{name} has no options, so not {', '.join(options)}")
    experiment.check()
    return experiment


def describe(vehicle: str) -> Any:
    """Names, a line about each, and the options of all as <name>.<option>."""
    experiments = {name: find(name, vehicle) for name in EXPERIMENTS}
    descriptors = [
        to_descriptor(replace(description, name=f"{name}.{description.name}"))
        for name, experiment in experiments.items()
        if experiment.parameters is not None
        for description in ParameterStore(experiment.parameters).descriptions()
    ]
    lines = [(type(e).__doc__ or "").strip().splitlines()[0] for e in experiments.values()]
    return new(
        ANSWER,
        accepted=True, names=list(experiments), descriptions=lines, descriptors=descriptors,
    )  # fmt: skip
