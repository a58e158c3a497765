"""Reports of logs agree with the log, and bad logs get one line."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from html import unescape
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest

from console.experiments.catalogue import experiments
from console.reports.content import Picture
from console.reports.flight import flight_of
from console.reports.judgement import Judgement, judge
from console.reports.run_log import read_run
from console.runs.report_folders import report_folder, write_result
from extensions.reports.experiment_figures import MAKERS
from extensions.reports.html import render
from extensions.reports.report import assemble, write_report
from flight_log import LogWriter
from flight_log.reader import read_log
from quadlab.__main__ import main
from quadlab.simulated.sensors import new_defaults
from quadrotor.calibration_record import CalibrationRecord, Quality
from quadrotor.errors import LogFormatError, StorageError, UsageError
from vehicle_link.messages import encode, new
from vehicle_link.topics.control_inputs import decode_external_reference
from vehicle_link.topics.ticks import decode_odometry


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the log of a hover in simulated time, by a vehicle heavier than its model."""
    folder = tmp_path_factory.mktemp("flights")
    main(["fly", "hover", "--set", "simulator.mass=1.35", "--out", str(folder)])
    [path] = folder.glob("*.mcap")
    return path


@pytest.fixture(scope="module")
def page(log: Path) -> str:
    """Return the report's HTML."""
    html, paper = write_report(log, log.parent / "report", defaults=new_defaults)
    assert paper.read_bytes().startswith(b"%PDF")
    return html.read_text()


class Words(HTMLParser):
    """Cells of all tables by row, and all that is fetched or run."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.rows: list[list[str]] = []
        self.tags: set[str] = set()
        self.links: list[str] = []
        self.alts: list[str] = []
        self._cell = False
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        if tag == "tr":
            self.rows.append([])
        self._cell = tag in ("td", "th")
        if self._cell:
            self.rows[-1].append("")
        told = dict(attrs)
        self.links += [told[name] or "" for name in ("src", "href") if name in told]
        if tag == "img":
            self.alts.append(told.get("alt") or "")

    def handle_endtag(self, tag: str) -> None:
        self._cell = self._cell and tag not in ("td", "th")

    def handle_data(self, data: str) -> None:
        if self._cell:
            self.rows[-1][-1] += data

    def row(self, first: str) -> list[str]:
        return next(row for row in self.rows if row and row[0] == first)


def undrawn(path: Path) -> str:
    """Return the page of a log without its pictures."""
    report = assemble(read_run(path), None, new_defaults)
    report.blocks = [one for one in report.blocks if not isinstance(one, Picture)]
    return "".join(render(report))


def write_log(
    path: Path, messages: Sequence[tuple[str, str, Mapping[str, object]]], **more: bytes
) -> Path:
    """Write a log of /quad1 with these messages, 20 ms apart."""
    attachments = {name.replace("_", "."): content for name, content in more.items()}
    writer = LogWriter(path, {"vehicle": "quad1"}, attachments)
    for k, (topic, kind, fields) in enumerate(messages):
        stamp = 1_700_000_000_000_000_000 + 20_000_000 * k
        writer.write(f"/quad1/{topic}", kind, encode(new(kind, **fields)), stamp, stamp)
    writer.close()
    return path


def test_figures_are_those_of_the_log(log: Path, page: str) -> None:
    words = Words(page)
    run = read_run(log)
    [(start, end)] = [(a, b) for a, b, name in run.spans("status", "behavior") if name == "hover"]
    wanted = {
        message.publish_ns: decode_external_reference(message.payload)[1]["position_w"][0].copy()
        for message in read_log(log, {"/quad1/reference"})
    }
    errors = []
    for message in read_log(log, {"/quad1/truth"}):
        stamp, state = decode_odometry(message.payload)
        if start + 2.0 <= (stamp - run.start_ns) * 1e-9 <= end:
            errors.append(state["position_w"][0] - wanted[stamp])
    distance = np.linalg.norm(errors, axis=1)
    shown = float(words.row("position rms")[1].removesuffix(" mm"))
    assert shown == pytest.approx(1e3 * np.sqrt(np.mean(distance**2)), rel=2e-3)
    largest = float(words.row("position max")[1].removesuffix(" mm"))
    assert largest == pytest.approx(1e3 * distance.max(), rel=2e-3)
    assert words.row("position rms")[2:] == ["5 mm", "EXCEEDED"]
    assert "✗ failed" in page
    assert words.row("motor reference in hover")[1] == "127 counts"
    count = sum(1 for _ in read_log(log))
    assert f"{count} messages" in page
    assert words.row("truth")[1] == str(len(run.topics["truth"].time))


def test_parameters_that_differ_come_first_and_all_are_there(log: Path, page: str) -> None:
    words = Words(page)
    rows = [row for row in words.rows if row and row[0] == "simulator.mass"]
    assert rows[0] == ["simulator.mass", "1.35", "1.308"]
    assert len(rows) == 2
    differing = page.index("Differing from")
    assert differing < page.index("parameters</summary>")
    for name in read_run(log).parameters:
        assert f"<td>{name}</td>" in page, name


def test_the_page_stands_alone(page: str) -> None:
    words = Words(page)
    assert not words.tags & {"script", "link", "iframe", "object", "form"}
    assert all(link.startswith("data:image/") for link in words.links)
    assert not re.search(r"url\(|@import", page)
    assert len(words.alts) >= 4
    assert all(len(alt) > 20 for alt in words.alts)
    assert len(page) < 2_500_000


def test_versions_and_events_are_told(log: Path, page: str) -> None:
    words, run = Words(page), read_run(log)
    assert words.row("quadlab")[1].startswith(run.run["git_revision"])
    assert words.row("numpy")[1] == json.loads(run.run["versions"])["numpy"]
    told = {row[2] for row in words.rows if len(row) == 4}
    for line in run.lines:
        assert line.text in told


def test_a_judged_run_is_shown_as_it_was_judged(log: Path, tmp_path: Path) -> None:
    copy = tmp_path / log.name
    copy.write_bytes(log.read_bytes())
    report_folder(copy).mkdir()
    record = CalibrationRecord(
        name="mass",
        values={"model.mass": 1.35},
        quality=(Quality(name="standard deviation", value=0.001, unit="kg", limit=0.002),),
    )
    write_result(
        copy,
        {
            "experiment": "hover",
            "verdict": "passed",
            "metrics": {"position_rms_m": 0.00123},
            "limits": {"position_rms_m": 0.005},
            "options": {"who": "<i>me</i>"},
            "proposal": record.model_dump(),
            "decision": "accepted",
        },
    )
    page = undrawn(copy)
    words = Words(page)
    assert words.row("position rms") == ["position rms", "1.23 mm", "5 mm", "kept"]
    assert words.row("who")[1] == "<i>me</i>"
    assert "It was accepted." in page
    assert words.row("model.mass")[1] == "1.35"


def test_a_run_that_was_not_judged_says_so_and_why(log: Path, tmp_path: Path) -> None:
    copy = tmp_path / log.name
    copy.write_bytes(log.read_bytes())
    report_folder(copy).mkdir()
    write_result(
        copy,
        {
            "experiment": "hover",
            "verdict": "not_judged",
            "reason": "no limit for position_rms_m",
            "metrics": {"position_rms_m": 0.00123},
            "limits": {},
            "options": {},
        },
    )
    page = undrawn(copy)
    assert 'class="verdict not_judged"' in page
    assert "no limit for position_rms_m" in page
    assert page.count("not judged") == 1, "the reason does not repeat the verdict"


def test_what_people_wrote_is_never_markup(tmp_path: Path) -> None:
    evil = '<script>alert("1")</script><img src=x onerror=alert(2)>'
    kind = "rcl_interfaces/Log"
    path = write_log(tmp_path / "evil.mcap", [("events", kind, {"msg": evil, "level": 30})] * 3)
    html, paper = write_report(path, tmp_path)
    page = html.read_text()
    assert "<script" not in page
    assert "onerror=alert(2)>" not in page
    assert evil in unescape(page)
    assert "WARNING" in page
    assert "Nothing can be drawn" in page
    assert "<h2>Calibrations in force</h2>\n<p>Not recorded in this log.</p>" in page
    assert paper.stat().st_size > 1000


def test_calibrations_in_force_are_those_of_the_log(tmp_path: Path) -> None:
    record = CalibrationRecord(
        name="motor",
        values={"model.torque_ratio": 0.0171},
        run_id="run 7",
        requester="ada",
        stamp_ns=1_700_000_000_000_000_000,
        previous={"model.torque_ratio": 0.0174},
    )
    content = {"in_force": {"motor": record.model_dump()}, "problem": ""}
    kind = "sensor_msgs/BatteryState"
    path = write_log(
        tmp_path / "a.mcap",
        [("battery", kind, {"voltage": 15.0 + 0.01 * k}) for k in range(9)],
        calibrations_json=json.dumps(content).encode(),
    )
    words = Words(undrawn(path))
    assert words.row("motor")[:4] == ["motor", "2023-11-14 22:13 UTC", "ada", "run 7"]
    assert words.row("model.torque_ratio") == ["model.torque_ratio", "0.0171", "0.0174"]


def test_gaps_are_told(tmp_path: Path) -> None:
    kind = "sensor_msgs/BatteryState"
    writer = LogWriter(tmp_path / "gap.mcap", {"vehicle": "quad1"}, {})
    for k in [*range(50), *range(100, 150)]:
        payload = encode(new(kind, voltage=15.0))
        writer.write("/quad1/battery", kind, payload, 10_000_000 * k, 10_000_000 * k)
    writer.close()
    words = Words(undrawn(tmp_path / "gap.mcap"))
    assert words.row("battery") == ["battery", "100", "66.4", "1", "0.51"]
    assert ["0.49", "0.51", "battery"] in words.rows


def test_a_torn_log_is_reported_up_to_the_tear(log: Path, tmp_path: Path) -> None:
    torn = tmp_path / "torn.mcap"
    content = log.read_bytes()
    torn.write_bytes(content[: len(content) // 2])
    page = undrawn(torn)
    assert "the file is torn: it ends within a record" in page
    assert 5.0 < read_run(torn).duration < read_run(log).duration
    assert torn.stat().st_size == len(content) // 2


def test_bad_logs_and_folders_get_one_line(tmp_path: Path, log: Path) -> None:
    other = tmp_path / "other.mcap"
    other.write_bytes(b"no log at all")
    empty = tmp_path / "empty.mcap"
    empty.write_bytes(b"")
    nothing = write_log(tmp_path / "nothing.mcap", [])
    for path, error, said in (
        (tmp_path / "none.mcap", StorageError, "cannot read .*none.mcap"),
        (tmp_path, StorageError, "is a folder"),
        (other, LogFormatError, "not an MCAP log"),
        (empty, LogFormatError, "nothing was recorded"),
        (nothing, LogFormatError, "nothing to show: it has no message"),
    ):
        with pytest.raises(error, match=said) as caught:
            write_report(path, tmp_path / "out")
        assert "\n" not in str(caught.value)
    foreign = tmp_path / f"{log.stem}.html"
    foreign.write_text("<p>mine</p>")
    with pytest.raises(StorageError, match="is not a report of quadlab"):
        write_report(log, tmp_path)
    assert foreign.read_text() == "<p>mine</p>"
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="cannot be written"):
        write_report(log, tmp_path / "file")


def test_the_command_writes_what_was_asked_for_and_refuses_the_rest(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kind = "rcl_interfaces/Log"
    path = str(write_log(tmp_path / "a.mcap", [("events", kind, {"msg": "hello"})]))
    out = tmp_path / "new" / "folder"
    assert main(["log", "report", path, "--out", str(out), "--no-pdf"]) == 0
    assert capsys.readouterr().out.split() == [str(out / "a.html")]
    assert [one.name for one in out.iterdir()] == ["a.html"]
    assert main(["log", "report", path, "--out", str(out)]) == 0  # its own report is replaced
    assert {one.name for one in out.iterdir()} == {"a.html", "a.pdf"}
    capsys.readouterr()
    assert main(["log", "report", str(tmp_path / "none.mcap")]) == 1
    assert main(["log", "info", path, "--no-pdf"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2
    assert "none.mcap is not a file" in said[0]
    assert "quadlab log info has no --no-pdf: its options are --" in said[1]


def test_an_experiment_without_its_topics_says_which(tmp_path: Path) -> None:
    kind = "quadlab_msgs/ExperimentStatus"
    told = [("experiment_status", kind, {"name": "motor_bench", "run_id": "bench"})]
    path = write_log(tmp_path / "bench.mcap", told)
    page = undrawn(path)
    assert "No figures of motor_bench: the log has no topic bench_reading, actuators" in page
    assert "Motor bench" in page


def test_an_experiment_is_that_of_the_log_s_own_run_and_none_before_it(tmp_path: Path) -> None:
    kind = "quadlab_msgs/ExperimentStatus"
    before = {
        "name": "accelerometer",
        "phase": "passed",
        "run_id": "earlier",
        "decision": "accepted",
        "proposal": CalibrationRecord(
            name="accelerometer", values={"imu.accelerometer.offset_x": 0.1}
        ).model_dump_json(),
    }
    log = write_log(tmp_path / "free.mcap", [("experiment_status", kind, before)])
    free = judged(log)
    assert (free.experiment, free.decision, free.proposal) == ("", "", None)
    assert undrawn(log).count("not judged") == 1
    starts = {"name": "motor_bench", "phase": "flying"}
    flies = {**starts, "run_id": "bench"}
    follows = {"name": "hover", "phase": "flying"}
    told = [("experiment_status", kind, one) for one in (before, starts, flies, follows)]
    bench = judged(write_log(tmp_path / "bench.mcap", told))
    assert (bench.experiment, bench.decision, bench.proposal) == ("motor_bench", "", None)


def judged(path: Path) -> Judgement:
    run = read_run(path)
    return judge(run, flight_of(run))


def test_without_matplotlib_it_is_told(
    log: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(UsageError, match="pip install matplotlib"):
        write_report(log, tmp_path)


def test_the_figures_of_reports_are_of_experiments() -> None:
    assert set(MAKERS) <= set(experiments())
