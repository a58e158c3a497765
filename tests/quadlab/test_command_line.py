"""Wrong words on the command line: one line, what was given and allowed; exit status 2 or 1."""

from __future__ import annotations

import json
import os
import platform
import re
import shlex
import socket
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import is_dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin, get_type_hints

import docstring_parser
import pytest

from control.margins import margins
from control.presets import PRESETS, preset
from quadlab.__main__ import main
from quadlab.commands import tracker
from quadlab.commands.parsing import parse
from quadlab.commands.table import commands, examples_of
from quadlab.settings import parse_settings
from quadlab.simulated.parameters import FlightParameters
from quadrotor.errors import UsageError
from vehicle.parameters import new_parameters
from vehicle.simulator.parameters import SimulatorParameters


def complaint(capsys: pytest.CaptureFixture[str], words: list[str], status: int) -> str:
    assert main(words) == status
    captured = capsys.readouterr()
    lines = captured.err.strip().splitlines()
    assert len(lines) == 1, f"not one line: {captured.err}"
    assert lines[0].startswith("quadlab: ")
    return lines[0]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["fly_8"], "up, fly"),
        (["fly"], "EXPERIMENT"),
        (["fly", "figure_nine"], "figure_eight"),
        (["fly", "hover", "--sed", "3"], "--seed"),
        (["fly", "--sed", "3"], "--seed"),  # before the experiment that is missing
        (["fly", "--bogus"], "--bogus"),
        (["log", "export", "--bogus"], "--bogus"),
        (["fly", "hover", "--seed", "x"], "--seed: 'x' is not a whole number"),
        (["vehicle", "--rate", "ten"], "--rate: 'ten' is not a number"),
        (["log", "info", "--for"], "--for"),
        (["fly", "hover", "--seed", "-1"], "allowed 0 to"),
        (["fly", "hover", "--set", "model.mas=1"], "model.mass"),
        (["fly", "hover", "--set", "model.mass=9"], "allowed 0.02 to 2.4 kg"),
        (["fly", "hover", "--set", "model.mass=nan"], "finite"),
        (["fly", "hover", "--set", "model.mass=heavy"], "a number"),
        (["fly", "hover", "--set", "model.mass"], "name=value"),
        (["up", "--port", "99999"], "is out of range (1 to 65535)"),
        (["up", "--port", "http"], "--port"),
        (["up", "--name", "a b/../c"], "allowed are up to 32 lower-case letters"),
        (["fly", "hover", "--set", "behavior.volume_x_min=50"], "not below"),
        (["up", "--set", "simulator.mas=1"], "mass"),
        (["log", "inspect", "x.mcap"], "info"),
    ],
)
def test_wrong_words_are_answered_in_one_line(
    capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    assert said in complaint(capsys, words, 2)


def test_a_wrong_word_is_told_before_a_port_in_use(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as used:
        words = ["up", "--port", str(used.getsockname()[1])]
        assert "did you mean mass" in complaint(capsys, [*words, "--set", "simulator.mas=1"], 2)
        assert "in use" in complaint(capsys, words, 2)


@pytest.mark.parametrize("command", commands())
def test_every_command_has_help(capsys: pytest.CaptureFixture[str], command: str) -> None:
    with pytest.raises(SystemExit) as stop:
        main([command, "--help"])
    assert stop.value.code in (0, None)
    assert "usage: quadlab" in capsys.readouterr().out


def options(command: Any) -> Iterator[tuple[str, str]]:
    """Yield the name and the docstring of each option of a command and its subcommands."""
    if get_origin(command) is Annotated:
        command = get_args(command)[0]
    for part in get_args(command):
        yield from options(part)
    if isinstance(command, type) and is_dataclass(command):
        for one in docstring_parser.parse_from_object(command).params:
            yield f"{command.__name__}.{one.arg_name}", one.description or ""
        for hint in get_type_hints(command, include_extras=True).values():
            yield from options(hint)


def test_help_is_wrapped_by_the_terminal_and_not_where_the_source_is() -> None:
    """tyro joins the lines of a docstring but for those that do not begin with a letter."""
    told = dict(pair for one in commands().values() for pair in options(one.load()))
    assert len(told) > 100
    for name, text in told.items():
        assert not re.search(r"\n *[^\s\w]|\n *[\d_]", text), name


def test_the_doctor_reports_versions_computer_and_checks_and_makes_nothing(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main(["doctor", "--data", str(tmp_path / "lab")]) == 0
    told = dict(re.findall(r"^([a-z ]+?)  +(.+)$", capsys.readouterr().out, re.MULTILINE))
    assert told["quadlab"].startswith(version("quadlab"))
    assert json.loads(told["versions"])["python"] == platform.python_version()
    assert told["data folder"].startswith("ok: ") or "free" in told["data folder"]
    assert not (tmp_path / "lab").exists()


def test_a_log_that_is_not_there_is_named(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert "no.mcap" in complaint(capsys, ["log", "info", str(tmp_path / "no.mcap")], 1)


def test_a_data_folder_that_is_a_file_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    words = ["fly", "hover", "--out", str(tmp_path / "file" / "data")]
    assert "--out DIR" in complaint(capsys, words, 1)
    words = ["up", "--no-browser", "--data", str(tmp_path / "file" / "data")]
    words += ["--port", "18082", "--link-port", "17449"]
    assert "--data DIR" in complaint(capsys, words, 1)


def test_certificates_that_do_not_fit_stop_up_before_it_starts(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    from vehicle_link.security.authority import ensure_certificates

    ensure_certificates(tmp_path / "data" / "certificates")
    foreign = ensure_certificates(tmp_path / "other")
    (tmp_path / "data" / "certificates" / "ca.pem").write_bytes(foreign.authority.read_bytes())
    words = ["up", "--no-browser", "--data", str(tmp_path / "data")]
    words += ["--port", "18083", "--link-port", "17450"]
    assert "was not signed by" in complaint(capsys, words, 1)


def test_a_full_disk_is_refused_before_anything_starts(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("quadlab.data_folder.FREE_SPACE_FLOOR", 10**18)
    line = complaint(capsys, ["fly", "hover", "--out", str(tmp_path)], 1)
    assert "MB free" in line
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("option", "kind"),
    [
        ("--port", socket.SOCK_STREAM),
        ("--link-port", socket.SOCK_DGRAM),
        ("--link-port", socket.SOCK_STREAM),
    ],
)
def test_a_port_in_use_is_named_with_the_option_that_changes_it(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, option: str, kind: socket.SocketKind
) -> None:
    with socket.socket(socket.AF_INET, kind) as taken:
        taken.bind(("127.0.0.1", 0))
        if kind == socket.SOCK_STREAM:
            taken.listen()
        port = taken.getsockname()[1]
        words = ["up", "--data", str(tmp_path), option, str(port), "--no-browser"]
        if option == "--port":
            words += ["--link-port", "17447"]
        else:
            words += ["--port", "18080"]
        line = complaint(capsys, words, 2)
    assert str(port) in line
    assert option in line


def test_a_second_up_on_the_same_data_folder_is_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    from quadlab.data_folder import open_data_folder, owned

    with owned(open_data_folder(tmp_path)):
        words = ["up", "--data", str(tmp_path), "--port", "18081", "--link-port", "17448"]
        line = complaint(capsys, [*words, "--no-browser"], 1)
    assert f"process {os.getpid()}" in line
    assert "--data DIR" in line


def test_the_module_runs_as_a_program() -> None:
    ran = subprocess.run(
        [sys.executable, "-m", "quadlab", "fly", "nothing"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 2
    assert ran.stderr.count("\n") == 1


def test_help_and_wrong_words_need_no_large_library() -> None:
    loaded = (
        "import sys, quadlab.__main__ as program; "
        "[one.load() for one in program.commands().values()]; print(*sys.modules)"
    )
    ran = subprocess.run([sys.executable, "-c", loaded], capture_output=True, text=True, check=True)
    assert "quadlab.commands.fly" in ran.stdout.split()
    assert not {"numpy", "numba", "pydantic", "pyarrow", "zenoh"} & set(ran.stdout.split())


def test_a_signal_leaves_the_interpreter_standing_too() -> None:
    """A thread of a library that calls Python during its shutdown aborts the process."""
    words = (
        "import atexit, sys, quadlab.__main__ as program; "
        "program.main = lambda: sys.exit(3); "
        "atexit.register(print, 'left in order'); "
        "kept = type('Kept', (), {'__del__': lambda self: print('taken apart')})(); "
        "program.program()"
    )
    ran = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=False)
    assert (ran.returncode, ran.stdout, ran.stderr) == (3, "left in order\n", "")


INTERRUPT_AT = """
import atexit, os, signal, sys

def interrupt():
    print("interrupted", flush=True)
    os.kill(os.getpid(), signal.SIGINT)

class Interrupting:
    def find_spec(self, name, path, target=None):
        if name == {moment!r}:
            interrupt()

sys.meta_path.insert(0, Interrupting())
if {moment!r} == "exit":
    atexit.register(interrupt)
"""


AS_MODULE, AS_PROGRAM = ("-m", "quadlab"), (Path(sys.executable).with_name("quadlab"),)


@pytest.mark.parametrize(
    ("start", "moment"),
    [
        (AS_MODULE, "quadlab.two_names"),
        (AS_MODULE, "quadlab.commands.table"),
        (AS_MODULE, "tyro"),
        (AS_MODULE, "control.margins"),
        (AS_MODULE, "exit"),
        (AS_PROGRAM, "quadlab.two_names"),
        (AS_PROGRAM, "quadlab.commands.table"),  # from main() on both are the same
        (AS_PROGRAM, "exit"),
    ],
)
def test_ctrl_c_ends_quietly_at_every_moment(
    tmp_path: Path, start: tuple[str, ...], moment: str
) -> None:
    """`control.margins` is imported by the command `gains`, all others before it."""
    (tmp_path / "sitecustomize.py").write_text(INTERRUPT_AT.format(moment=moment))
    ran = subprocess.run(
        [sys.executable, *start, "gains"],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "interrupted" in ran.stdout
    assert (ran.returncode, ran.stderr) == (130, "")


def test_a_notebook_keeps_its_own_ctrl_c() -> None:
    words = "import signal, quadlab.__main__; print(signal.getsignal(signal.SIGINT).__name__)"
    ran = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert ran.stdout == "default_int_handler\n"


def test_gains_prints_the_computed_margin_of_every_preset(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["gains"]) == 0
    out = capsys.readouterr().out
    expected = margins(preset("stiff"), 0.047)
    row = next(line for line in out.splitlines() if line.startswith("stiff"))
    for one in expected:
        assert f"{one.phase:.0f}° ({1e3 * one.delay:.0f} ms)" in row
    assert all(name in out for name in PRESETS)


def test_gains_that_oscillate_are_said_to(capsys: pytest.CaptureFixture[str]) -> None:
    bad = ["kp_xy=9", "kv_xy=5"]
    words = [f"control.position.{one}" for one in bad]
    words += ["control.attitude.kr_xy=30", "control.attitude.kw_xy=7.5"]
    assert main(["gains", "--set", *words]) == 0
    assert "do not fly it" in capsys.readouterr().out


def test_settings_may_follow_one_set_or_have_one_each() -> None:
    together = parse(["fly", "hover", "--set", "model.mass=1.2", "tracker.seed=3", "--json"])
    apart = parse(["fly", "hover", "--set", "model.mass=1.2", "--set", "tracker.seed=3", "--json"])
    assert together == apart
    assert vars(together)["set"] == ("model.mass=1.2", "tracker.seed=3")


def test_a_preset_sets_all_its_gains_and_later_words_change_them() -> None:
    parameters = new_parameters()
    words = ["control.preset=stiff", "control.attitude.kw_xy=18"]
    values = parse_settings(parameters, words)
    assert parameters.control.position.kp_xy == 6.0
    assert parameters.control.attitude.kw_xy == 18.0
    assert values["control.attitude.kr_xy"] == 100.0
    with pytest.raises(UsageError, match="'sporty'"):
        parse_settings(parameters, ["control.preset=sporty"])
    parse_settings(parameters, ["control.preset=observer"])
    assert dict(preset("observer")).items() <= dict(parameters.control).items()
    parse_settings(parameters, ["control.preset=standard"])
    assert dict(preset("standard")).items() <= dict(parameters.control).items()
    parse_settings(parameters, ["estimation.preset=paper"])
    assert parameters.estimation.position_bandwidth == 63.15
    with pytest.raises(UsageError, match="there are paper"):
        parse_settings(parameters, ["estimation.preset=sporty"])


def test_a_world_as_rough_as_a_real_one_is_one_word_and_clean_takes_it_back() -> None:
    parameters = FlightParameters().model_copy(deep=True)
    parse_settings(parameters, ["simulator.preset=rough", "simulator.gust=0"])
    assert parameters.simulator.vibration == 0.5
    assert parameters.simulator.gust == 0.0
    assert (parameters.model.drag, parameters.model.drag_lever) == (0.47, 0.02)
    parse_settings(parameters, ["simulator.preset=clean"])
    assert parameters.simulator == SimulatorParameters()
    simulator = SimulatorParameters()  # as `quadlab simulator` and `quadlab up` set it
    parse_settings(simulator, ["preset=rough"])
    assert simulator.lost_samples == 0.003
    for target, word in ((parameters, "simulator.preset=raw"), (simulator, "preset=raw")):
        with pytest.raises(UsageError, match="clean, rough"):
            parse_settings(target, [word])


def test_the_version_is_the_packages(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"quadlab {version('quadlab')}\n"


@pytest.mark.parametrize("words", [[], ["--help"]])
def test_the_overview_has_every_command_in_a_line_of_its_own(
    capsys: pytest.CaptureFixture[str], words: list[str]
) -> None:
    assert main(words) == 0
    listed = re.findall(r"^  (\w+) +[A-Z]", capsys.readouterr().out, re.MULTILINE)
    assert sorted(listed) == sorted(commands())


def test_every_command_has_examples_that_it_takes() -> None:
    for name, offered in commands().items():
        assert offered.offer.examples, name
        for example in offered.offer.examples:
            if "natnet" in example and "natnet" not in tracker.SYSTEMS:
                continue  # of an extension that is not there
            program, *words = shlex.split(example)
            assert (program, words[0]) == ("quadlab", name)
            assert isinstance(parse(words), offered.load()), example


def test_the_sentence_of_the_overview_is_the_first_of_the_help() -> None:
    for name, offered in commands().items():
        told = " ".join((offered.load().__doc__ or "").split("\n\n")[0].split())
        assert told == offered.offer.summary, name


def test_help_ends_with_the_examples(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["log", "info", "--help"])
    assert capsys.readouterr().out.endswith(examples_of("log"))


def test_bash_completes_words(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    with pytest.raises(SystemExit):
        main(["completion", "bash"])
    (tmp_path / "completion").write_text(capsys.readouterr().out)
    script = f"""source {tmp_path}/completion
        COMP_WORDS=(quadlab ca) COMP_CWORD=1 COMP_LINE="quadlab ca"
        $(complete -p quadlab | sed "s/.*-F \\([^ ]*\\).*/\\1/"); echo ${{COMPREPLY[@]}}"""
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
    expected = sorted(name for name in commands() if name.startswith("ca"))
    assert sorted(done.stdout.split()) == expected
    assert "calibrate" in expected
    assert "for bash, zsh or tcsh" in complaint(capsys, ["completion", "fish"], 2)


@pytest.mark.parametrize("words", [["log"], ["link"]])
def test_a_command_without_a_word_helps(
    capsys: pytest.CaptureFixture[str], words: list[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(words)
    assert not stop.value.code
    assert "usage: quadlab" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "meant"),
    [
        (["lgo"], "log"),
        (["flyy", "x"], "fly"),
        (["log", "inof", "x"], "info"),
        (["link", "lits"], "list"),
        (["user", "ad"], "add"),
    ],
)
def test_a_wrong_word_is_answered_with_the_nearest(
    capsys: pytest.CaptureFixture[str], words: list[str], meant: str
) -> None:
    assert f"did you mean {meant}" in complaint(capsys, words, 2)


@pytest.mark.parametrize("command", ["up", "vehicle"])
def test_a_law_that_is_not_there_stops_the_start_with_those_there_are(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    (tmp_path / "plugins").mkdir()
    (tmp_path / "plugins" / "mine.py").write_text("")
    ports = {"up": ["--port", "18391", "--link-port", "17991"], "vehicle": ["--serial", "none"]}
    words = [command, "--data", str(tmp_path), "--set", "control.law=mien", *ports[command]]
    assert main(words) == 2
    told = capsys.readouterr()
    assert "control.law = 'mien' is not one of geometric, near_hovering, " in told.err
    assert told.err.endswith(", udp, mine\n")
    assert told.out == ""
