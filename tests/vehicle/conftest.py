"""Vehicle on the ground in simulated time, for tests without a flight."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from quadrotor.calibration_record import CalibrationRecord, parse_record
from quadrotor.errors import LinkError, QuadlabError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import ParameterStore
from tests.support.lab import Lab, flight_parameters
from vehicle import mailbox
from vehicle.calibration.store import FOLDER, HISTORY, CalibrationStore
from vehicle.comms.calibrations import TYPE, Calibrations
from vehicle.modes import Mode
from vehicle_link.messages import new

NS = 1_780_000_000_000_000_000


class GroundLab(Lab):
    """Lab that is ready after 0.1 s; `found` are the outcomes of its gyroscope calibrations."""

    def __init__(self, **settings: Any) -> None:
        parameters = flight_parameters()
        named = {name.replace("__", "."): value for name, value in settings.items()}
        ParameterStore(parameters).preset({"safety.gyro_samples": 50} | named)
        self.found: list[mailbox.GyroscopeFound] = []
        super().__init__(parameters)

    def ask(self, command: mailbox.Command) -> mailbox.Reply:
        return self.stack.handle(command)

    def turn_motor(
        self, motor: int = 2, reference: int = 100, secured: bool = True
    ) -> mailbox.Reply:
        """Send the command once, without a retry."""
        return self.ask(mailbox.Bench("b", "anna", motor, reference, secured))

    def keep_turning(self, seconds: float, motor: int = 2, reference: int = 100) -> None:
        """Keep a motor turning on a bench that holds the vehicle."""
        self._simulate({"simulator.held": "bench"})
        for _ in range(round(seconds / 0.2)):
            assert self.turn_motor(motor, reference).accepted
            self.wait(0.2)

    @property
    def mode(self) -> Mode:
        return self.stack.mode

    def _gyroscope(self, found: mailbox.GyroscopeFound) -> None:
        super()._gyroscope(found)
        self.found.append(found)


class Wired:
    """Service between a folder and a vehicle in simulated time, which flies while it waits."""

    def __init__(self, lab: Any, data: Path, refused: list[int] | None = None) -> None:
        self.lab, self.data, self.said = lab, data, list[tuple[int, str]]()
        self.history = data / FOLDER / HISTORY
        self.is_silent = False
        self.store = CalibrationStore(data, lambda line: self.said.append((30, line)))
        self.now_ns = NS
        self.service = Calibrations(
            self,  # type: ignore[arg-type]
            self.store,
            lambda: self.now_ns,
            lambda level, text: self.said.append((level, text)),
            lambda: -4.99,  # the flight's outcome is available at once
            refused or [],
            since_ns=0,
        )

    def ask(self, make: Callable[[str], mailbox.Command]) -> mailbox.Reply:
        """Send a command, in place of FlightMailbox."""
        if self.is_silent:
            raise LinkError("the flight process did not answer within 1 s")
        reply: mailbox.Reply = self.lab.ask(make(f"asked {self.now_ns}"))
        self.lab.wait(0.3)
        for found in self.lab.found:
            self.service.found(found)
        self.lab.found.clear()
        return reply

    def call(self, action: str, record: str = "", request_id: str = "") -> list[CalibrationRecord]:
        answer = self.service.answer(self.request(action, record, request_id))
        return [parse_record(text) for text in answer.records]

    def request(self, action: str, record: str = "", request_id: str = "") -> Any:
        kind = f"{TYPE}_Request"
        return new(kind, request_id=request_id, requester="anna", action=action, record=record)

    def parameters(self, *names: str) -> dict[str, ParameterValue]:
        return {name: self.lab.parameter(name) for name in names}

    def refused(self, action: str, record: str = "", error: type = QuadlabError) -> str:
        """Return the reason of a refusal, after which nothing has changed."""
        before, stored = self.lab.stack.store.values(), self.store.newest_first()
        with pytest.raises(error) as caught:
            self.call(action, record)
        assert self.lab.stack.store.values() == before
        assert self.store.newest_first() == stored
        return str(caught.value)


@pytest.fixture
def lab() -> GroundLab:
    """Return a lab that is ready."""
    return GroundLab().ready()


@pytest.fixture
def new_lab() -> type[GroundLab]:
    """Return the class of labs, to make one with settings, like `simulator__seed=3`."""
    return GroundLab


@pytest.fixture
def wired(lab: Any, tmp_path: Path) -> Wired:
    lab.found.clear()  # those of its start
    return Wired(lab, tmp_path)


@pytest.fixture
def wire() -> type[Wired]:
    """Return the class that connects a vehicle by hand."""
    return Wired
