"""Guided procedures at the station: shown, confirmed, recorded on the ground, proposed, decided."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from console.calibrations import Calibrations
from console.catalogue.catalogue import Catalogue
from console.experiment_running import evaluation
from console.experiment_running.evaluation import Evaluation, EvaluationJob, evaluate, judge
from console.experiment_running.runner import ExperimentRunner
from console.experiments.client import Client, Result, VehicleView
from console.experiments.readings import Progress
from console.experiments.user_file import load
from console.parameters.store import StationStore
from console.runs.report_folders import read_result, report_folder
from console.runs.runs import RunManager
from flight_log import LogWriter, read_attachments
from quadrotor.calibration_record import CalibrationRecord, Quality, parse_record
from quadrotor.errors import JobError, LinkError, MeasurementError, RefusedError, StorageError
from tests.support.clients import FakeClient
from vehicle_link.messages import header, new
from vehicle_link.parameters.messages import from_parameters, to_parameters, to_value
from vehicle_link.topics.table import SERVICES
from vehicle_link.transport.heartbeat import LinkState
from vehicle_link.transport.idempotent import answering

BOUND = 60.0
ENDED = ("passed", "failed", "stopped", "refused")
PROPOSED = CalibrationRecord(
    name="motor",
    values={"model.motor_offset": 11.0},
    quality=(Quality(name="residual", value=0.1, unit="count", limit=0.2),),
)


class LocalNode:
    """Services of one process, without a session."""

    full_name = "/quad1/station"

    def __init__(self) -> None:
        self.handlers: dict[str, Callable[[Any], Any]] = {}

    def serve(self, name: str, kind: str, handler: Callable[[Any], Any], **_: Any) -> None:
        self.handlers[name] = answering(kind, handler) if kind else handler

    def client(self, name: str, kind: str, priority: str = "") -> Any:
        def answer(request: Any) -> Any:
            if name not in self.handlers:
                raise LinkError(f"nobody serves {name}")
            return self.handlers[name](request)

        return FakeClient(name, kind, answer)


class Vehicle:
    """A vehicle's calibrations, its bench, and its simulator, if any."""

    def __init__(self, node: LocalNode) -> None:
        self.node = node
        self.history: list[CalibrationRecord] = []
        self.benched: list[tuple[int, int, bool, str]] = []
        self.refusal, self.silent = "", False
        self.held: list[dict[str, Any]] = []
        node.serve("calibrate", "", self._calibrate)
        node.serve("bench", "", self._bench)

    def simulate(self, held: str = "free") -> None:
        self.held.append({"simulator.held": held})
        self.node.serve("/quad1/simulator/get_parameters", "", self._get)
        self.node.serve("simulator/change_parameters", "", self._change)

    def _calibrate(self, request: Any) -> Any:
        answer = f"{SERVICES['calibrate']}_Response"
        if request.action == "store":
            if self.refusal:
                return new(answer, accepted=False, reason=self.refusal)
            self.history.insert(0, parse_record(request.record))
            if self.silent:
                raise LinkError("calibrate did not answer within 2 s")
        elif request.action == "gyroscope":
            self.history.insert(0, CalibrationRecord(name="gyroscope", requester=request.requester))
            return new(answer, accepted=True, records=[self.history[0].model_dump_json()])
        elif request.action == "in_force":
            newest = {record.name: record for record in reversed(self.history)}.values()
            return new(answer, accepted=True, records=[r.model_dump_json() for r in newest])
        return new(answer, accepted=True, records=[r.model_dump_json() for r in self.history])

    def _bench(self, request: Any) -> Any:
        asked = (request.motor, request.reference, request.secured, request.requester)
        self.benched.append(asked)
        reason = self.refusal
        return new(f"{SERVICES['bench']}_Response", accepted=not reason, reason=reason)

    def _get(self, request: Any) -> Any:
        values = [to_value(self.held[-1]["simulator.held"])]
        return new("rcl_interfaces/srv/GetParameters_Response", values=values)

    def _change(self, request: Any) -> Any:
        self.held.append(from_parameters(request.parameters))
        return new(f"{SERVICES['change_parameters']}_Response", accepted=True)


class Outbox:
    def __init__(self) -> None:
        self.said: list[str] = []
        self.told: list[Any] = []

    def say(self, level: int, line: str) -> None:
        self.said.append(line)

    def message(self, name: str, message: Any, stamp_ns: int) -> None:
        self.told.append(message)

    def joy(self, order: Any) -> None: ...


class Parameters:
    def __init__(self) -> None:
        self.values = {"safety.bench_timeout": 5.0}  # s

    def snapshot(self) -> Any:
        return self.values, 1, ""

    def refresh(self) -> None: ...

    def newest(self, name: str) -> float | None:
        return self.values.get(name)

    def defaults(self) -> Any:
        return {}


class Lab:
    """A runner with the station's own recorder, and its other parts."""

    def __init__(self, data: Path) -> None:
        node = LocalNode()
        self.vehicle, self.outbox = Vehicle(node), Outbox()
        self.catalogue, self.calibrations = Catalogue(data), Calibrations(node)  # type: ignore[arg-type]
        store, parameters, outbox = StationStore(), Parameters(), self.outbox
        store.preset({"station.recorder.keep_free": 10.0, "station.recorder.after_disarm": 0.0})
        self.runs = RunManager(
            self.catalogue,
            store,
            parameters,  # type: ignore[arg-type]
            "quad1",
            "",
            self.calibrations.attachment,
        )
        self.link = LinkState.GOOD
        context = SimpleNamespace(
            node=node,
            vehicle="quad1",
            link=SimpleNamespace(state=lambda: self.link, vehicle_ns=time.time_ns),
            outbox=outbox,
            parameters=store.parameters,
        )
        self.runner = ExperimentRunner(
            context,  # type: ignore[arg-type]
            parameters,  # type: ignore[arg-type]
            self.runs,
            self.calibrations,
            self.catalogue,
            lambda *_: None,
            lambda *_: None,
        )
        self._ask = node.handlers["station/experiment"]
        self.status("ready")

    def start(self, name: str, **options: Any) -> str:
        request = new(
            f"{SERVICES['experiment']}_Request",
            requester="ada",
            action="start",
            name=name,
            options=to_parameters(options),
        )
        return str(self._ask(request).reason)

    def described(self) -> tuple[list[str], list[str], list[str]]:
        told = self._ask(new(f"{SERVICES['experiment']}_Request", action="describe"))
        return list(told.names), list(told.calibrations), list(told.problems)

    def status(self, mode: str) -> None:
        self._mode = mode
        message = new(
            "quadlab_msgs/VehicleStatus",
            header=header(time.time_ns()),
            mode=mode,
            armed=mode in ("armed", "bench"),
        )
        self.runner.feed.status(message)
        self.runs.status(bool(message.armed), mode == "starting")

    def do(self, action: str, requester: str = "ada", **options: Any) -> str:
        """Return the reason of a refusal; empty if accepted."""
        request = new(
            f"{SERVICES['experiment']}_Request",
            request_id=f"{time.monotonic_ns()}",
            requester=requester,
            action=action,
            options=to_parameters(options),
        )
        return str(self._ask(request).reason)

    def until(self, condition: Callable[[], Any]) -> bool:
        end = time.monotonic() + BOUND
        while not condition() and time.monotonic() < end:
            threading.Event().wait(0.005)
            self.status(self._mode)
            self.runs.tick()
            self.runner.tick(4)
        return bool(condition())

    def asked(self, question: str) -> None:
        assert self.until(lambda: self.runner._state.question == question), self.runner._state

    def ended(self) -> Any:
        assert self.until(lambda: self.runner._state.phase in ENDED), self.runner._state
        return self.outbox.told[-1]

    def fly(self, script: Callable[[Client], None]) -> Any:
        self.runner.start(Scripted(script), "ada")
        return self.ended()

    def close(self) -> None:
        self.runner.close()
        self.runs.close()
        self.catalogue.close()


def without_result(act: Callable[[Client], object]) -> Callable[[Client], None]:
    def script(client: Client) -> None:
        act(client)

    return script


class Scripted:
    """Experiment whose flight is a function of the test."""

    name, parameters, planned = "scripted", None, 5.0

    def __init__(self, script: Callable[[Client], None]) -> None:
        self._script = script

    def check(self) -> None: ...

    def fly(self, client: Client) -> None:
        self._script(client)

    def evaluate(self, log: Path) -> Result:
        raise NotImplementedError


@pytest.fixture
def lab(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Lab]:
    """Yield a lab that judges without a process: passed, proposing a law of the motors."""
    result = Evaluation(Result("passed", {}), (), "", PROPOSED.model_dump_json())
    monkeypatch.setattr(evaluation, "judge", lambda *_: result)
    made = Lab(tmp_path)
    yield made
    made.close()


def test_what_to_do_and_how_far_it_is_are_in_the_status(lab: Lab) -> None:
    go = threading.Event()

    def script(client: Client) -> None:
        client.tell(Progress("turn it", 2, 12, 0.25, {"rate": (1.5, "°/s")}))
        client.tell(Progress("hold still", 3, 12, float("nan"), {"rate": (0.5, "°/s")}))
        go.wait(BOUND)

    lab.runner.start(Scripted(script), "ada")
    assert lab.until(lambda: lab.outbox.told[-1].instruction == "hold still")
    told = lab.outbox.told[-1]
    assert (told.step_number, told.step_count, told.step_share) == (3, 12, 0.0)
    assert (told.live_names, list(told.live_values), told.live_units) == (["rate"], [0.5], ["°/s"])
    go.set()
    done = lab.ended()
    assert (done.phase, done.instruction, done.step_count) == ("passed", "", 0)


def test_progress_that_no_message_can_carry_is_the_scripts_defect(lab: Lab) -> None:
    done = lab.fly(lambda client: client.tell(Progress("go", share="half")))  # type: ignore[arg-type]
    assert done.phase == "failed"
    assert "a defect of the experiment" in done.reason
    assert lab.outbox.told[-1].phase == "failed", "the beat goes on"


def test_a_question_waits_for_one_yes_to_it_and_it_is_kept_who_said_so(lab: Lab) -> None:
    def script(client: Client) -> None:
        client.confirm("propellers off?")
        client.confirm("all clear?")

    assert lab.do("confirm") == "no question is open"
    lab.runner.start(Scripted(script), "ada")
    lab.asked("propellers off?")
    assert lab.do("confirm", "grace", question="propellers off?") == ""
    lab.asked("all clear?")
    twice = lab.do("confirm", "grace", question="propellers off?")
    assert twice == "another question is open now: all clear?"
    assert lab.runner._state.phase == "flying"
    assert lab.do("confirm", "grace") == ""
    assert lab.ended().phase == "passed"
    assert "grace confirmed: propellers off?" in lab.outbox.said


@pytest.mark.parametrize(
    ("action", "said"), [("stop", "stopped by grace"), ("finish", "before the question was")]
)
def test_stop_and_finish_are_no_yes(lab: Lab, action: str, said: str) -> None:
    after: list[str] = []

    def script(client: Client) -> None:
        client.confirm("propellers off?")
        after.append("went on")

    lab.runner.start(Scripted(script), "ada")
    lab.asked("propellers off?")
    assert lab.do(action, "grace") == ""
    done = lab.ended()
    assert (done.phase, done.question, after) == ("stopped", "", [])
    assert said in done.reason


def test_on_the_ground_a_run_lasts_from_the_first_guided_step_to_the_end(lab: Lab) -> None:
    lab.vehicle.history = [
        CalibrationRecord(name="mass", values={"model.mass": 1.2}),
        CalibrationRecord(name="mass", values={"model.mass": 1.1}),
    ]
    lab.calibrations.look(1)
    ids: list[str] = []

    def script(client: Client) -> None:
        ids.append(lab.runs.recorder.run_id)
        client.imu()
        ids.append(lab.runs.recorder.run_id)

    done = lab.fly(script)
    assert (ids[0], done.run_id) == ("", ids[1])
    assert lab.runs.recorder.wait_idle(BOUND)
    entry = lab.catalogue.get(ids[1])
    assert (entry.complete, entry.operator) == (True, "ada")
    kept = json.loads(read_attachments(lab.catalogue.resolve(ids[1]))["calibrations.json"])
    assert kept["problem"] == ""
    assert {name: one["values"] for name, one in kept["in_force"].items()} == {
        "mass": {"model.mass": 1.2}
    }


def test_a_vehicle_that_does_not_tell_its_calibrations_is_recorded_as_unknown(lab: Lab) -> None:
    del lab.vehicle.node.handlers["calibrate"]
    lab.calibrations.look(1)
    done = lab.fly(without_result(lambda client: client.imu()))
    assert lab.runs.recorder.wait_idle(BOUND)
    kept = json.loads(read_attachments(lab.catalogue.resolve(done.run_id))["calibrations.json"])
    assert kept == {"in_force": None, "problem": "unknown: nobody serves calibrate"}


def test_motors_that_stop_in_between_do_not_end_the_run(lab: Lab) -> None:
    ids: list[str] = []

    def script(client: Client) -> None:
        client.tell(Progress("go"))
        for mode in ("bench", "ready", "bench", "ready"):
            lab.status(mode)
            for _ in range(3):
                lab.runs.tick()
            ids.append(lab.runs.recorder.run_id)

    done = lab.fly(script)
    assert set(ids) == {done.run_id}
    assert lab.until(lambda: not lab.runs.recorder.run_id)


def test_a_run_begun_by_hand_is_the_experiments_and_ends_with_it(lab: Lab) -> None:
    by_hand = lab.runs.by_hand(True, "grace")
    done = lab.fly(lambda client: client.tell(Progress("go")))
    assert (done.phase, done.run_id, lab.runs.recorder.run_id) == ("passed", by_hand, "")


def test_without_a_run_nothing_is_begun(lab: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> str:
        raise StorageError("only 1 MB are free")

    monkeypatch.setattr(lab.runs, "start", full)
    done = lab.fly(lambda client: client.tell(Progress("go")))
    assert done.phase == "refused"
    assert done.reason == "no run can be recorded for judging: only 1 MB are free"


def test_a_simulated_vehicle_is_turned_and_let_go_whatever_comes(lab: Lab) -> None:
    lab.vehicle.simulate(held="hand")  # left by a station that crashed

    def script(client: Client) -> None:
        assert client.simulated
        client.turn((0.0, 1.0, 0.0, 0.0))
        raise RefusedError("not still")

    assert lab.fly(script).phase == "refused"
    assert [held["simulator.held"] for held in lab.vehicle.held] == ["hand", "free", "hand", "free"]
    assert abs(lab.vehicle.held[2]["simulator.hand_roll"]) == pytest.approx(180.0)


def test_a_real_vehicle_is_not_turned(lab: Lab) -> None:
    def script(client: Client) -> None:
        assert not client.simulated
        client.tell(Progress("turn it"))
        client.turn((1.0, 0.0, 0.0, 0.0))
        client.turn(None)

    assert lab.fly(script).phase == "passed"
    assert lab.vehicle.held == []


@pytest.mark.parametrize(
    "attitude", [(1.0, 1.0, 0.0, 0.0), (1.0, 0.0), "level", (float("nan"),) * 4]
)
def test_what_is_no_attitude_is_refused(lab: Lab, attitude: Any) -> None:
    lab.vehicle.simulate()
    done = lab.fly(lambda client: client.turn(attitude))
    assert "an attitude is a unit quaternion" in done.reason


def test_the_gyroscopes_drift_is_found_in_the_starters_name(lab: Lab) -> None:
    found: list[CalibrationRecord] = []
    lab.fly(lambda client: found.append(client.calibrate_gyroscope()))
    assert [(one.name, one.requester) for one in found] == [("gyroscope", "ada")]


def test_a_bench_is_secured_on_the_simulators_sensor_and_ended_with_the_experiment(
    lab: Lab,
) -> None:
    lab.vehicle.simulate()
    proceed = threading.Event()

    def script(client: Client) -> None:
        client.bench(1, 30)
        proceed.wait(BOUND)
        client.wait(0.0)

    lab.runner.start(Scripted(script), "ada")
    assert lab.until(lambda: lab.vehicle.benched)
    lab.status("bench")
    assert lab.until(lambda: len(lab.vehicle.benched) >= 3), "asked for again"
    assert set(lab.vehicle.benched) == {(1, 30, True, "ada")}
    assert lab.vehicle.held[-1] == {"simulator.held": "bench"}
    lab.runner.commanded("disarm", "grace")
    assert lab.until(lambda: lab.vehicle.benched[-1][:2] == (0, 0)), "before the script looks"
    have = len(lab.vehicle.benched)
    proceed.set()
    done = lab.ended()
    assert (done.phase, done.reason) == ("stopped", "grace took over with disarm")
    assert len(lab.vehicle.benched) == have
    assert lab.vehicle.held[-1] == {"simulator.held": "free"}


def test_a_bench_that_the_vehicle_ends_ends_the_script(lab: Lab) -> None:
    def script(client: Client) -> None:
        client.bench(1, 30)
        lab.vehicle.refusal = "the vehicle turned by 30°"
        client.wait(BOUND)

    done = lab.fly(script)
    assert (done.phase, done.reason) == ("failed", "the vehicle turned by 30°")


@pytest.mark.parametrize(("motor", "reference"), [(5, 30), (-1, 30), (1, 256), (1, -1)])
def test_no_motor_is_asked_for_that_there_is_not(lab: Lab, motor: int, reference: int) -> None:
    done = lab.fly(lambda client: client.bench(motor, reference))
    assert "allowed are motors 1 to 4" in done.reason
    assert lab.vehicle.benched == []


def test_an_accepted_proposal_is_kept_once_with_its_run_and_who_accepted(lab: Lab) -> None:
    assert lab.do("accept") == "no calibration is proposed, so there is nothing to decide"
    done = lab.fly(lambda client: client.tell(Progress("go")))
    assert (parse_record(done.proposal), done.decision) == (PROPOSED, "")
    lab.vehicle.refusal = "on the ground only"
    assert lab.do("accept", "grace") == "on the ground only"
    assert (lab.runner._state.decision, lab.vehicle.history) == ("", [])
    lab.vehicle.refusal = ""
    assert lab.do("accept", "grace") == ""
    [kept] = lab.vehicle.history
    assert kept == PROPOSED.model_copy(update={"run_id": done.run_id, "requester": "grace"})
    assert lab.outbox.told[-1].decision == "accepted"
    for action in ("accept", "reject"):
        assert "was accepted already" in lab.do(action)
    assert len(lab.vehicle.history) == 1


def test_a_rejected_proposal_changes_nothing(lab: Lab) -> None:
    lab.fly(lambda client: client.tell(Progress("go")))
    assert lab.do("reject", "grace") == ""
    assert "was rejected already" in lab.do("accept")
    assert (lab.vehicle.history, lab.outbox.told[-1].decision) == ([], "rejected")


def test_only_the_newest_proposal_can_be_decided(lab: Lab) -> None:
    lab.fly(lambda client: client.tell(Progress("go")))
    go = threading.Event()
    lab.runner.start(Scripted(without_result(lambda _: go.wait(BOUND))), "ada")
    assert "no calibration is proposed" in lab.do("accept")
    go.set()
    lab.ended()


def test_an_answer_that_was_lost_is_not_stored_twice(lab: Lab) -> None:
    lab.fly(lambda client: client.tell(Progress("go")))
    lab.vehicle.silent = True
    assert "it is not known whether the vehicle applied it" in lab.do("accept")
    lab.vehicle.silent = False
    before = len(lab.vehicle.history)  # each of the two tries, which a vehicle distinguishes by id
    assert lab.do("accept") == ""
    assert len(lab.vehicle.history) == before


def test_the_station_tells_the_vehicles_calibrations_and_takes_none(lab: Lab) -> None:
    def asked(action: str) -> Any:
        kind = f"{SERVICES['calibrate']}_Request"
        return lab.vehicle.node.handlers["station/calibrate"](new(kind, action=action))

    assert asked("history").reason == (
        "the vehicle's calibrations are not known: not received from the vehicle yet"
    )
    lab.vehicle.history = [CalibrationRecord(name="mass"), CalibrationRecord(name="gyroscope")]
    lab.calibrations.look(5)
    assert [parse_record(text).name for text in asked("history").records] == ["mass", "gyroscope"]
    assert {parse_record(text).name for text in asked("in_force").records} == {"mass", "gyroscope"}
    for action in ("store", "gyroscope", ""):
        assert not asked(action).accepted
    assert len(lab.vehicle.history) == 2
    lab.calibrations.lost()
    assert "the link to the vehicle is lost" in asked("history").reason


def test_they_are_read_anew_when_the_vehicle_has_started(lab: Lab) -> None:
    lab.calibrations.look(5)
    assert lab.calibrations.in_force() == {}
    lab.vehicle.history = [CalibrationRecord(name="gyroscope", requester="start")]
    lab.calibrations.look(5)
    assert lab.calibrations.in_force() == {}, "not asked at each look"
    for starting in (True, False):
        lab.calibrations.status(starting)
    lab.calibrations.look(5)
    assert list(lab.calibrations.in_force() or {}) == ["gyroscope"]
    lab.vehicle.history.clear()
    lab.calibrations.look(6)  # another process
    assert lab.calibrations.in_force() == {}


class Judged(Scripted):
    """Experiment judged without a log."""

    def __init__(self, result: Result, record: CalibrationRecord | Exception = PROPOSED) -> None:
        super().__init__(lambda client: None)
        self._result, self._record = result, record

    def evaluate(self, log: Path) -> Result:
        return self._result

    def proposal(self, log: Path) -> CalibrationRecord:
        if isinstance(self._record, Exception):
            raise self._record
        return self._record


def empty(folder: Path) -> Path:
    """Return the path of a log without messages."""
    LogWriter(folder / "r.mcap", {}, {}).close()
    return folder / "r.mcap"


@pytest.mark.parametrize(
    ("result", "said"),
    [
        (Result("fine", {}), "the verdict of scripted is 'fine'; allowed are passed, failed"),
        (Result("passed", {"rms": "small"}), "are numbers by name"),  # type: ignore[dict-item]
        (Result("passed", {}, ["rms"]), "are numbers by name"),  # type: ignore[arg-type]
    ],
)
def test_a_judgement_that_makes_no_sense_is_none(tmp_path: Path, result: Result, said: str) -> None:
    with pytest.raises(MeasurementError, match=said):
        evaluate(EvaluationJob(Judged(result), empty(tmp_path), 1.0))
    assert not report_folder(tmp_path / "r.mcap").exists()


@pytest.mark.parametrize(
    ("record", "said"),
    [
        (MeasurementError("pose 3 is missing"), "nothing is proposed: pose 3 is missing"),
        (
            ZeroDivisionError("by zero"),
            "nothing is proposed because of a software error: ZeroDivisionError",
        ),
        (
            PROPOSED.model_copy(update={"figures": (Quality(name="rms", value=float("nan")),)}),
            "nothing is proposed: not a calibration record: figures.0.value",
        ),
    ],
)
def test_without_a_proposal_the_verdict_stands(tmp_path: Path, record: Any, said: str) -> None:
    result = Result("passed", {"n": float(np.float32(2))}, {"n": 3.0})
    told = evaluate(EvaluationJob(Judged(result, record), empty(tmp_path), 1.0))
    assert (told["verdict"], told["metrics"], told["proposal"]) == ("passed", {"n": 2.0}, None)
    assert said in told["problem"]


def test_a_pass_by_no_limit_at_all_is_not_judged(tmp_path: Path) -> None:
    told = evaluate(EvaluationJob(Judged(Result("passed", {"n": 2.0})), empty(tmp_path), 1.0))
    assert told["verdict"] == "not_judged"
    assert told["reason"]


def test_what_no_other_process_can_have_is_not_judged(tmp_path: Path) -> None:
    experiment = Judged(Result("passed", {}))  # has a function made in a method
    with pytest.raises(JobError, match=r"scripted .*cannot be given to another process"):
        judge(EvaluationJob(experiment, tmp_path / "run.mcap", 1.0), threading.Event())


OWN = '''"""A person's own."""
from console.experiments.client import Result
from quadrotor.calibration_record import CalibrationRecord


class Mine:
    """Finds a mass without flying."""

    name = "mine"
    parameters = None
    planned = 1.0

    def check(self):
        # what cannot be known before
        pass  # check

    def fly(self, client):
        self.found = 1.25
        client.imu()

    def evaluate(self, log):
        return Result("passed", {"mass_kg": self.found}, {"mass_kg": 2.0})

    def proposal(self, log):
        return CalibrationRecord(name="mass", values={"model.mass": self.found})
'''


def test_the_exception_of_a_file_of_ones_own_is_told_with_its_line(
    lab: Lab, tmp_path: Path
) -> None:
    path = tmp_path / "mine.py"
    path.write_text(OWN.replace("self.found = 1.25", "self.found = 1 / 0"))
    lab.runner.start(load(path), "ada")
    done = lab.ended()
    assert (done.phase, done.reason) == (
        "refused",
        "mine.py line 18: ZeroDivisionError: division by zero",
    )
    assert lab.fly(lambda client: client.tell(Progress("go"))).phase == "passed", "the next one"


class Ruled(Scripted):
    """Guided experiment with its own rules."""

    missing, why = "", ""

    def preconditions(self, view: VehicleView) -> str:
        return self.missing

    def abort(self, view: VehicleView) -> str:
        return self.why


@pytest.mark.parametrize(
    ("rule", "phase", "reason"),
    [("missing", "refused", "not started: too far"), ("why", "failed", "aborted: too far")],
)
def test_the_rules_of_an_experiment_hold_at_the_station_too(
    lab: Lab, rule: str, phase: str, reason: str
) -> None:
    def script(client: Client) -> None:
        client.tell(Progress("go"))
        client.wait(BOUND)

    experiment = Ruled(script)
    setattr(experiment, rule, "too far")
    lab.runner.start(experiment, "ada")
    done = lab.ended()
    assert (done.phase, done.reason) == (phase, reason)


@pytest.fixture
def own(tmp_path: Path) -> Iterator[Lab]:
    """Yield a lab for files of users, checked and judged in their processes."""
    folder = tmp_path / "experiments"
    folder.mkdir()
    for name, text in {
        "mine.py": OWN,
        "broken.py": OWN.replace("def evaluate(self, log)", "def evaluate(self)"),
        "leaves.py": "import os\nos._exit(3)\n",
    }.items():
        (folder / name).write_text(text)
    made = Lab(tmp_path)
    yield made
    made.close()


def test_a_file_of_ones_own_is_listed_flown_judged_and_accepted_and_broken_ones_say_why(
    own: Lab,
) -> None:
    def looked_at() -> bool:
        names, _, problems = own.described()
        known = {"mine", "broken.py", "leaves.py"} <= set(names)
        return known and not any("being looked at" in problem for problem in problems)

    assert own.until(looked_at)
    names, calibrations, problems = own.described()
    listed = dict(zip(names, zip(calibrations, problems, strict=True), strict=True))
    assert listed["mine"] == ("mine", "")
    assert "broken.py line 21: Mine cannot be called as it will be" in listed["broken.py"][1]
    assert listed["leaves.py"][1] == "leaves.py line 1: its process ended with status 3"
    assert (listed["hover"], listed["motor_bench"]) == (("", ""), ("motor", ""))
    assert "broken.py cannot run: broken.py line 21" in own.start("broken.py")
    assert "mine has no options; leave out speed" in own.start("mine", speed=1.0)
    assert own.start("mine") == ""
    done = own.ended()
    assert (done.phase, done.reason, done.metric_names) == ("passed", "", ["mass_kg"])
    assert parse_record(done.proposal).values == {"model.mass": 1.25}
    assert own.do("accept", "grace") == ""
    report = read_result(own.catalogue.resolve(done.run_id))
    assert report["proposal"]["values"] == {"model.mass": 1.25}
    assert (report["decision"], report["decided_by"]) == ("accepted", "grace")
