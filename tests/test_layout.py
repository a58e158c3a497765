"""The checkout is what runs: no other distribution's `control` or `console` is imported."""

from __future__ import annotations

import importlib.util
import tomllib
from pathlib import Path

import pytest

from quadrotor import checkout

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"][
    "root_packages"
]


@pytest.mark.parametrize("package", PACKAGES)
def test_every_top_level_package_resolves_inside_the_repository(package: str) -> None:
    spec = importlib.util.find_spec(package)
    assert spec is not None, f"{package} is not importable: run scripts/setup dev"
    assert spec.origin is not None
    found = Path(spec.origin).resolve()
    assert found.is_relative_to(ROOT), (
        f"`import {package}` finds {found}, which is not of this checkout: another distribution "
        "has the same name; use the environment that scripts/setup makes, and nothing else in it"
    )


def test_every_package_below_quadlab_is_put_there_by_the_wheel() -> None:
    assert {*checkout.PACKAGES, "quadlab"} == set(PACKAGES)
    assert (checkout.PREFIX, checkout.IMPORTED_FROM) == ("", ROOT)


def test_floors_of_the_lock_and_the_project_agree() -> None:
    """uv.lock names the project with exactly the dependencies of pyproject.toml."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lock = tomllib.loads((ROOT / "uv.lock").read_text())
    ours = next(p for p in lock["package"] if p["name"] == "quadlab")
    locked = {d["name"] for d in ours["metadata"]["requires-dist"] if "marker" not in d}
    wanted = {d.split(">")[0].split("[")[0].strip() for d in project["dependencies"]}
    assert locked == wanted, "run `uv lock`"
