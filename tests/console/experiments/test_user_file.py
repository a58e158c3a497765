"""A user's own experiment: loaded, refused with its line, pickled to another process."""

from __future__ import annotations

import pickle
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from console.experiments.catalogue import experiments, find
from console.experiments.client import Calibrating, Experiment, Reporting
from console.experiments.user_file import UserFileError, errors_with_line, is_file, load
from console.experiments.watched import Abortable, Conditional
from quadrotor.checkout import ROOT
from quadrotor.errors import RefusedError, StorageError, UsageError
from quadrotor.parameters import Parameters

EXAMPLE = ROOT / "examples/experiments/side_step.py"
GOOD = """
from quadrotor.parameters import Parameters, parameter

class Options(Parameters):
    count: int = parameter(3, ge=1, le=9, description="how often")

class Mine:
    name = "mine"
    planned = 5.0
    def __init__(self, vehicle="quad1"):
        self.parameters = Options()
        self.vehicle = vehicle
        self.flown = 0
    def check(self): ...
    def fly(self, client):
        self.flown = 1 / client
    def evaluate(self, log):
        return self.flown
"""


def written(folder: Path, source: str) -> Path:
    path = folder / "mine.py"
    path.write_text(source)
    return path


def test_a_file_is_told_from_a_name() -> None:
    assert is_file("mine.py")
    assert is_file("./folder/mine")
    assert not any(map(is_file, experiments()))


def test_the_file_s_class_becomes_an_experiment(tmp_path: Path) -> None:
    experiment = load(written(tmp_path, GOOD), "quad7")
    assert (experiment.name, experiment.planned) == ("mine", 5.0)
    assert isinstance(experiment.parameters, Parameters)
    assert vars(experiment)["vehicle"] == "quad7"
    assert not isinstance(experiment, Reporting | Calibrating | Abortable | Conditional)


def test_a_class_without_a_constructor_is_one_too(tmp_path: Path) -> None:
    source = GOOD.replace('    def __init__(self, vehicle="quad1"):\n', "").replace(
        "        self.parameters = Options()\n        self.vehicle = vehicle\n"
        "        self.flown = 0\n",
        "    parameters = None\n",
    )
    assert load(written(tmp_path, source)).parameters is None


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("def check(self): ...", "def check(self) ..."), "mine.py line 14: SyntaxError"),
        (("from quad", "import nothing_like_it\nfrom quad"), "mine.py line 2: ModuleNotFoundError"),
        (("class Mine:", "class Mine:\n    x = 1 / 0"), "mine.py line 8: ZeroDivisionError"),
        (("def fly(self, client)", "def go(self, client)"), "line 7: Mine has no method fly"),
        (("def evaluate(self, log)", "def eval(self)"), "line 7: Mine has no method evaluate"),
        (("def check(self): ...", ""), "line 7: Mine has no method check: add `def check"),
        (("def fly(self, client)", "def fly(self)"), "line 15: Mine cannot be called as it"),
        (("def check(self)", "def check(self, log)"), "line 14: Mine cannot be called as it"),
        (("    planned = 5.0\n", ""), "line 7: Mine has no 'planned'"),
        (("planned = 5.0", "planned = 'long'"), "planned = 'long'; set it to the seconds"),
        (('name = "mine"', 'name = "my own"'), "has the name 'my own', allowed are a to z"),
        (("self.parameters = Options()", "self.parameters = {}"), "neither None nor Parameters"),
        (("self.flown = 0", "self.flown = nothing"), "mine.py line 13: NameError"),
        (
            ("def check(self): ...", "def abort(self): ...\n    def check(self): ..."),
            "line 14: Mine cannot be called as it will be: write `def abort(self, view",
        ),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_a_broken_file_is_refused_with_its_line(
    tmp_path: Path, change: tuple[str, str], said: str
) -> None:
    source = GOOD.replace(*change)
    assert source != GOOD
    with pytest.raises(UsageError) as caught:
        load(written(tmp_path, source))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_a_file_of_none_and_a_file_of_two_are_refused(tmp_path: Path) -> None:
    with pytest.raises(StorageError, match=r"absent\.py cannot be read: No such file"):
        load(tmp_path / "absent.py")
    with pytest.raises(UsageError, match="has no experiment, which is a class with the methods"):
        load(written(tmp_path, "import math\n"))
    twice = GOOD + GOOD[GOOD.index("class Mine") :].replace("Mine", "Yours")
    with pytest.raises(UsageError, match=r"Mine \(line 7\) and Yours \(line 19\)"):
        load(written(tmp_path, twice))


def test_an_exception_of_the_file_is_told_with_its_line(tmp_path: Path) -> None:
    experiment = load(written(tmp_path, GOOD))
    with (
        pytest.raises(UserFileError, match=r"^mine\.py line 16: ZeroDivisionError: division"),
        errors_with_line(experiment),
    ):
        experiment.fly(0)  # type: ignore[arg-type]


def test_errors_made_for_users_pass_and_built_in_defects_are_not_hidden(tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match="no"), errors_with_line(load(written(tmp_path, GOOD))):
        raise RefusedError("no")
    with pytest.raises(ZeroDivisionError), errors_with_line(find("hover")):
        print(1 / 0)


def test_another_process_gets_the_source_that_was_flown(tmp_path: Path) -> None:
    path = written(tmp_path, GOOD.replace(', description="how often")', ")\n    'how often'"))
    experiment = load(path)
    experiment.fly(0.25)  # type: ignore[arg-type]
    parameters: Any = experiment.parameters
    parameters.count = 8
    load(path)  # a page may list it again in the meantime
    sent = pickle.dumps(experiment)
    path.write_text("changed since")
    script = (
        "import pickle, sys; one = pickle.load(sys.stdin.buffer); "
        "about = type(one.parameters).model_fields['count'].description.split()[-1]; "
        "print(type(one).__name__, one.evaluate(None), one.parameters.count, about)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], input=sent, capture_output=True, cwd=ROOT, check=True
    )
    assert done.stdout.decode().split() == ["Mine", "4.0", "8", "often"]


def test_the_example_is_a_whole_one() -> None:
    example: Experiment = load(EXAMPLE)
    assert example.name not in experiments()
    assert isinstance(example, Abortable)
    assert isinstance(example, Conditional)
