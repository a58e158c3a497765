"""The service `experiment`: each answer has its reason, and retries are idempotent."""

from __future__ import annotations

import threading
from dataclasses import replace
from typing import Any, Protocol

from console.experiment_running.file_check import Described
from console.experiments.catalogue import EXPERIMENTS, find
from console.experiments.client import Calibrating, Experiment
from console.experiments.user_file import mistakes_told
from quadrotor.errors import UsageError
from quadrotor.parameters import ParameterStore
from vehicle_link.messages import new
from vehicle_link.parameters.messages import from_parameters, to_descriptor
from vehicle_link.topics import SERVICES
from vehicle_link.transport.idempotent import Idempotent
from vehicle_link.transport.node import Node

ANSWER = f"{SERVICES['experiment']}_Response"
RECORDS = {"motor_bench": "motor"}
"""Calibrations whose name differs from that of their experiment."""


class Runner(Protocol):
    """The runner's interface for the service; each method raises RefusedError with the reason."""

    def permit(self, command: str, requester: str) -> None: ...

    def check_free(self) -> None: ...

    def start(self, experiment: Experiment, requester: str) -> None: ...

    def finish(self, requester: str) -> None: ...

    def stop(self, requester: str) -> None: ...

    def confirm(self, question: str, requester: str) -> None: ...

    def accept(self, requester: str) -> None: ...

    def reject(self, requester: str) -> None: ...


class Files(Protocol):
    """The users' own experiments."""

    def described(self) -> list[Described]: ...

    def find(self, name: str) -> Experiment | None: ...


class ExperimentService:
    """Serves `/<vehicle>/station/experiment` in its own thread."""

    def __init__(self, node: Node, vehicle: str, runner: Runner, files: Files) -> None:
        self._vehicle = vehicle
        self._runner, self._files = runner, files
        self._lock = threading.Lock()
        node.serve("station/experiment", SERVICES["experiment"], Idempotent(self._answer))

    def _answer(self, request: Any) -> Any:
        with self._lock:
            return self._do(request)

    def _do(self, request: Any) -> Any:
        requester = request.requester or "someone"
        if request.action == "describe":
            return describe(self._vehicle, self._files)
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
                f"{request.action!r} is no action; there are start, finish, stop, confirm, accept, "
                "reject and describe"
            )
        return new(ANSWER, accepted=True)

    def _prepared(self, name: str, options: dict[str, Any]) -> Experiment:
        """Return the experiment with these options. Raises QuadlabError with the reason."""
        own = None if name in EXPERIMENTS else self._files.find(name)
        experiment = own or find(name, self._vehicle)
        if experiment.parameters is not None:
            ParameterStore(experiment.parameters).set(options)
        elif options:
            raise UsageError(f"{name} has no options, so not {', '.join(options)}")
        with mistakes_told(experiment):
            experiment.check()
        return experiment


def describe(vehicle: str, files: Files) -> Any:
    """Return the experiments' names, a line about each, and the options of all as
    <name>.<option>.
    """
    listed = [*(_built_in(name, vehicle) for name in EXPERIMENTS), *files.described()]
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


def _built_in(name: str, vehicle: str) -> Described:
    experiment = find(name, vehicle)
    options = experiment.parameters
    return Described(
        name,
        (type(experiment).__doc__ or "").strip().splitlines()[0],
        () if options is None else ParameterStore(options).descriptions(),
        RECORDS.get(name, name) if isinstance(experiment, Calibrating) else "",
    )
