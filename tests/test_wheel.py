"""The wheel beside another distribution that has our names, in an environment of its own."""

from __future__ import annotations

import re
import runpy
import subprocess
import venv
import zipfile
from collections.abc import Iterator
from importlib import import_module
from importlib.metadata import Distribution, PackagePath, distribution
from pathlib import Path

import numpy as np
import pytest
from packaging.requirements import Requirement

from quadrotor import errors
from quadrotor.checkout import PACKAGES, ROOT

BACKEND = runpy.run_path(str(ROOT / "scripts" / "quadlab_build.py"))
THEIRS = 'def tf():\n    return "theirs"\n'
"""Stands for python-control."""
PLUGIN = """
import control
from control.allocation import __name__ as ours
from quadlab.vehicle.laws.contract import Input as in_a_wheel
from vehicle.laws.contract import Input as in_a_checkout

assert control.tf() == "theirs" and ours == "quadlab.control.allocation"
assert in_a_wheel is in_a_checkout

class law:
    def reset(self): pass
    def step(self, x): return x.mass * 9.81, [0.0, 0.0, 0.0]
"""
NOTEBOOK = """
import quadlab, control, sys
from pathlib import Path
from quadlab.__main__ import main
from quadlab.vehicle.laws.contract import hovering, load
from quadlab.vehicle_link.jobs import run

assert control.tf() == "theirs" and not hasattr(control, "trajectories")
assert callable(quadlab.open) and callable(quadlab.fly) and callable(quadlab.connect)
assert control is sys.modules["control"]
thrust, _ = load(Path("plugins/mine.py")).step(hovering(mass=2.0))
assert thrust == 2.0 * 9.81
assert main(["new", "law", "new", "--out", "plugins"]) == 0
assert "from quadlab.vehicle.laws.contract import" in Path("plugins/new.py").read_text()
load(Path("plugins/new.py"))
from vehicle.laws.laws import Laws  # as in a checkout
assert Laws(Path("plugins")).names()[-2:] == ("mine", "new")
from quadlab.vehicle.boards.kind import find_kind
find_kind("mikrokopter")
from quadlab.flight_log.provenance import provenance
assert run(provenance) == provenance()  # in a process of its own
from quadlab.web.static_files import FILES
print(FILES.document("console/index.html").body.decode())
from quadlab.web.features import panels_of_extensions
from quadlab.web.static_files import files_with
panels = tuple(panels_of_extensions())
assert panels and files_with(panels).problems == []
"""


@pytest.fixture(scope="module")
def python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the interpreter of a new environment with the wheel; its dependencies are ours."""
    folder = tmp_path_factory.mktemp("wheel")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        wheel = BACKEND["build_wheel"](str(folder))
    venv.create(folder / "env", symlinks=True)
    site = next((folder / "env" / "lib").glob("python*/site-packages"))
    zipfile.ZipFile(folder / wheel).extractall(site)
    (site / "control").mkdir()
    (site / "control" / "__init__.py").write_text(THEIRS)
    (site / "dependencies.pth").write_text(str(Path(np.__file__).parents[1]))
    (folder / "plugins").mkdir()
    (folder / "plugins" / "mine.py").write_text(PLUGIN)
    return folder / "env" / "bin" / "python"


def test_an_editable_installation_imports_nothing_when_python_starts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    wheel = zipfile.ZipFile(tmp_path / BACKEND["build_editable"](str(tmp_path)))
    [path] = [name for name in wheel.namelist() if "/" not in name]
    assert path.endswith(".pth")
    [line] = wheel.read(path).decode().splitlines()
    assert Path(line).resolve() == ROOT  # no import


def _run(python: Path, *words: str) -> str:
    done = subprocess.run(
        [python, *words], cwd=python.parents[2], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_in_a_wheel_commands_plugins_and_the_page_work_beside_python_control(python: Path) -> None:
    assert _run(python, "-m", "quadlab", "--version") == "quadlab 0.1.0\n"
    page = _run(python, "-c", NOTEBOOK)
    assert "<title>quadlab" in page


def test_a_wheel_has_nothing_outside_quadlab_and_every_file_in_its_record(python: Path) -> None:
    wheel = zipfile.ZipFile(next(python.parents[2].glob("*.whl")))
    names = set(wheel.namelist())
    assert {name.split("/")[0] for name in names} == {"quadlab", "quadlab-0.1.0.dist-info"}
    record = wheel.read("quadlab-0.1.0.dist-info/RECORD").decode().splitlines()
    assert {line.rsplit(",", 2)[0] for line in record} == names
    assert "quadlab/web/static/console/index.html" in names
    assert "quadlab/vehicle_link/messages/quadlab_msgs/msg/Reference.msg" in names


@pytest.fixture(scope="module")
def vehicle_python(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the interpreter of a new environment with the vehicle's wheel and its libraries."""
    folder = tmp_path_factory.mktemp("vehicle")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        wheel = BACKEND["build_wheel"](str(folder), {"for": "vehicle"})
    venv.create(folder / "env", symlinks=True)
    site = next((folder / "env" / "lib").glob("python*/site-packages"))
    zipfile.ZipFile(folder / wheel).extractall(site)
    for file in _with_what_they_need(_required(_distribution_at(site, "quadlab-vehicle"))):
        top = file.parts[0]
        if top not in ("..", "__pycache__") and not (site / top).exists():
            (site / top).symlink_to(Path(np.__file__).parents[1] / top)
    return folder / "env" / "bin" / "python"


def _distribution_at(site: Path, name: str) -> Distribution:
    return next(iter(Distribution.discover(name=name, path=[str(site)])))


def _required(of: Distribution) -> set[str]:
    found = map(Requirement, of.requires or [])
    return {one.name for one in found if one.marker is None or one.marker.evaluate({"extra": ""})}


def _with_what_they_need(names: set[str]) -> Iterator[PackagePath]:
    """Yield the files of these distributions and of those that they need."""
    waiting, seen = sorted(names), set()
    while waiting:
        if (name := waiting.pop()) not in seen:
            seen.add(name)
            waiting += _required(distribution(name))
            yield from distribution(name).files or []


def test_the_vehicle_s_wheel_runs_with_its_few_libraries_alone(vehicle_python: Path) -> None:
    modules = (
        "from quadlab.vehicle.flight import process\nfrom quadlab.vehicle.comms import process"
    )
    _run(vehicle_python, "-c", modules)
    overview = _run(vehicle_python, "-m", "quadlab")
    listed = re.findall(r"(?m)^  (\w+)  +[A-Z]", overview)
    assert listed == ["doctor", "vehicle"]
    found = _run(vehicle_python, "-m", "quadlab", "doctor")
    assert re.search(r"extensions +betaflight, crazyflie, fmu, laws\n", found)
    assert "--link-port" in _run(vehicle_python, "-m", "quadlab", "vehicle", "--help")
    for words, told in (
        (["up"], "quadlab: the command up is not in quadlab-vehicle, the part"),
        (["upp"], "quadlab: there is no command 'upp'; there are doctor, vehicle;"),
        (["vehicle", "--serial", "none", "--set", "control.law=x"], "quadlab: --set control.law=x"),
    ):
        refused = subprocess.run(
            (vehicle_python, "-m", "quadlab", *words),
            cwd=vehicle_python.parents[2],
            capture_output=True,
            text=True,
            check=False,
        )
        assert (refused.returncode != 0, refused.stderr[: len(told)]) == (True, told)
        assert refused.stderr.count("\n") == 1


def test_a_wheel_for_something_else_is_refused() -> None:
    with pytest.raises(ValueError, match=r"no setting \{'for': 'page'\}; allowed is for=vehicle"):
        BACKEND["build_wheel"]("nowhere", {"for": "page"})


def test_imports_are_put_below_quadlab_and_a_bare_one_is_refused() -> None:
    below = BACKEND["below_quadlab"]
    assert below(
        "", "from control import x\n    from web.a.b import (\nimport vehicle.c as d\n"
    ) == (
        "from quadlab.control import x\n    from quadlab.web.a.b import (\n"
        "import quadlab.vehicle.c as d\n"
    )
    for kept in ("from controls import x\n", "from vehicle to station\n", "import webcolors\n"):
        assert below("", kept) == kept
    with pytest.raises(ValueError, match=r"a\.py: `import control\.law` has no `as`"):
        below("a.py", "x = 1\nimport control.law\n")


def test_no_text_of_the_product_is_the_name_of_one_of_its_modules() -> None:
    """Name a module by its `__name__` or `__package__`: "console.reports" is none in a wheel."""
    names = re.compile(rf"[\"']((?:{'|'.join(PACKAGES)})(?:\.\w+)+)[\"']")
    named = {"vehicle/flight/kernels.py", "extensions/comparison/kernels.py"}  # for `kept`
    parameter = "estimation.estimator"
    found = [
        f"{file}: {match[1]}"
        for file in BACKEND["_files"]("quadlab", *PACKAGES)
        if file.suffix == ".py" and str(file.relative_to(ROOT)) not in named
        for match in names.finditer(file.read_text())
        if ROOT.joinpath(*match[1].split(".")).with_suffix(".py").exists() and match[1] != parameter
    ]
    assert found == []


def test_in_a_checkout_a_module_has_the_name_of_a_wheel_too() -> None:
    assert import_module("quadlab.quadrotor.errors") is errors
    with pytest.raises(ModuleNotFoundError, match=r"quadlab\.quadrotor\.nothing"):
        import_module("quadlab.quadrotor.nothing")
