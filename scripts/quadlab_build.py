"""The build backend: setuptools, but in a wheel every package is below `quadlab`.

In a checkout the packages are folders of the repository, and `control` and `console` are names that
other distributions have too. In a wheel `control` is `quadlab.control`: its folder is moved and the
imports are rewritten (docs/decisions/0001). Editable installations are setuptools' own, which
add the checkout to the search path.

With the setting `for=vehicle` the wheel is `quadlab-vehicle`: what runs on the vehicle's computer,
with the few libraries that it needs (`[tool.quadlab.vehicle]` in pyproject.toml).
"""

from __future__ import annotations

import ast
import base64
import hashlib
import io
import json
import re
import runpy
import sys
import tarfile
import tempfile
import tomllib
import zipfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from setuptools import build_meta
from setuptools.build_meta import *  # noqa: F403 - the hooks that stay as they are

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from quadrotor.checkout import PACKAGES  # noqa: E402

# Not imported: its package needs libraries, which are not installed where a wheel is built.
PROVENANCE = runpy.run_path(str(ROOT / "flight_log" / "provenance.py"))
REVISION: str = PROVENANCE["REVISION"]
BESIDES = ("docs", "examples", "firmware")
"""Folders that the page, `quadlab new` and the C firmware need at run time."""
SOURCES = ("pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "scripts/quadlab_build.py")
"""Files from which a wheel is built, other than the packages."""
WHEEL = "Wheel-Version: 1.0\nGenerator: quadlab\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
VEHICLE = (
    "quadrotor",
    "control",
    "estimation",
    "bearing_sim",
    "vehicle_link",
    "flight_log",
    "vehicle",
)
"""The packages of the vehicle's part; of `quadlab` it has the modules of its commands."""
_ON_BOARD = re.compile(r"^ +(?:offers=\()?(?:Board|Law|Link|PluginFormat)\(", re.M)
"""A pattern of offers in a declaration that make an extension one of the vehicle's part."""
_OURS = "|".join(PACKAGES)
_IMPORT = re.compile(rf"^(\s*(?:from|import) )(?=(?:{_OURS})\b[\w.]* (?:import|as) )", re.M)
_BARE = re.compile(rf"^\s*import (?:{_OURS})\b[\w.]*\s*$", re.M)


def build_wheel(
    wheel_directory: str, config_settings: Any = None, metadata_directory: str | None = None
) -> str:
    """Write the wheel into a folder and return its name. Raises ValueError for other settings."""
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder, prepare_metadata_for_build_wheel(folder, config_settings))
        files = dict(_packaged(_of_vehicle() if _is_for_vehicle(config_settings) else _of_all()))
        for file in made.rglob("*"):
            if file.is_file() and file.name != "top_level.txt":
                files[f"{made.name}/{file.relative_to(made)}"] = file.read_bytes()
        files |= {f"{made.name}/WHEEL": WHEEL.encode(), f"{made.name}/top_level.txt": b"quadlab\n"}
        name = f"{made.name.removesuffix('.dist-info')}-py3-none-any.whl"
        record = "".join(f"{path},{_digest(data)},{len(data)}\n" for path, data in files.items())
        files[f"{made.name}/RECORD"] = f"{record}{made.name}/RECORD,,\n".encode()
    with zipfile.ZipFile(Path(wheel_directory, name), "w", zipfile.ZIP_DEFLATED) as archive:
        for path, data in files.items():
            archive.writestr(zipfile.ZipInfo(path), data, zipfile.ZIP_DEFLATED)
    return name


def prepare_metadata_for_build_wheel(metadata_directory: str, config_settings: Any = None) -> str:
    """Write the folder of a wheel's metadata and return its name. Raises ValueError as above."""
    for_vehicle = _is_for_vehicle(config_settings)
    made = Path(metadata_directory, build_meta.prepare_metadata_for_build_wheel(metadata_directory))
    if not for_vehicle:
        return made.name
    wanted = _vehicle_settings()["dependencies"]
    lines = []
    for line in (made / "METADATA").read_text().splitlines(keepends=True):
        key, _, value = line.rstrip().partition(": ")
        if key == "Name":
            lines.append("Name: quadlab-vehicle\n")
        elif key == "Provides-Extra" or (key == "Requires-Dist" and _project(value) not in wanted):
            continue
        else:
            lines.append(line)
    (made / "METADATA").write_text("".join(lines))
    renamed = made.with_name(made.name.replace("quadlab-", "quadlab_vehicle-", 1))
    return made.rename(renamed).name


def build_sdist(sdist_directory: str, config_settings: Any = None) -> str:
    """Write the archive of what a wheel is built from, and return its name."""
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder, build_meta.prepare_metadata_for_build_wheel(folder))
        metadata = (made / "METADATA").read_bytes()
    stem = made.name.removesuffix(".dist-info")
    files = {path: (ROOT / path).read_bytes() for path in SOURCES}
    files |= {str(p.relative_to(ROOT)): p.read_bytes() for p in _of_all()}
    files |= {"PKG-INFO": metadata, REVISION: _revision()}
    with tarfile.open(Path(sdist_directory, f"{stem}.tar.gz"), "w:gz") as archive:
        for path, data in files.items():
            entry = tarfile.TarInfo(f"{stem}/{path}")
            entry.size = len(data)
            archive.addfile(entry, io.BytesIO(data))
    return f"{stem}.tar.gz"


def below_quadlab(path: str, source: str) -> str:
    """Return a module's source with the imports of a wheel. Raises ValueError where that is not
    possible."""
    if bare := _BARE.search(source):
        raise ValueError(f"{path}: `{bare[0].strip()}` has no `as`; write `from … import …`")
    return _IMPORT.sub(r"\1quadlab.", source)


def _is_for_vehicle(settings: Any) -> bool:
    given = dict(settings or {})
    if given not in ({}, {"for": "vehicle"}):
        raise ValueError(f"there is no setting {given}; allowed is for=vehicle, or nothing")
    return bool(given)


def _vehicle_settings() -> dict[str, list[str]]:
    settings: dict[str, list[str]] = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"][
        "quadlab"
    ]["vehicle"]
    return settings


def _project(requirement: str) -> str:
    """Return the name of the project that a requirement without an extra names; "" with one."""
    return "" if "extra ==" in requirement else re.split(r"[^\w.-]", requirement)[0]


def _of_all() -> Iterator[Path]:
    return _files("quadlab", *PACKAGES, *BESIDES)


def _of_vehicle() -> Iterator[Path]:
    """Yield the files of the vehicle's part."""
    yield from _files(*VEHICLE)
    yield from sorted(_imported(ROOT / root for root in _vehicle_settings()["roots"]))
    yield ROOT / "extensions" / "__init__.py"
    for declaration in sorted((ROOT / "extensions").glob("*/extension.py")):
        if _ON_BOARD.search(declaration.read_text()):
            yield from _files(str(declaration.parent.relative_to(ROOT)))


def _imported(roots: Iterable[Path]) -> set[Path]:
    """Return these modules of `quadlab` and those that they import when they are imported."""
    found: set[Path] = set()
    waiting = [ROOT / "quadlab" / "__init__.py", *roots]
    while waiting:
        file = waiting.pop()
        if file in found or not file.is_file():
            continue
        found.add(file)
        waiting += [parent / "__init__.py" for parent in file.parents if ROOT in parent.parents]
        for node in ast.parse(file.read_text()).body:
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("quadlab"):
                module = ROOT / str(node.module).replace(".", "/")
                waiting += [module.with_suffix(".py"), module / "__init__.py"]
                waiting += [module / f"{alias.name}.py" for alias in node.names]
    return found


def _packaged(files: Iterable[Path]) -> Iterator[tuple[str, bytes]]:
    """Yield path and content of each of these files in a wheel, and of the revision."""
    for file in files:
        path, data = str(file.relative_to(ROOT)), file.read_bytes()
        if file.suffix == ".py":
            data = below_quadlab(path, data.decode()).encode()
        yield path if path.startswith("quadlab/") else f"quadlab/{path}", data
    yield f"quadlab/{REVISION}", _revision()


def _files(*folders: str) -> Iterator[Path]:
    for folder in folders:
        for file in sorted((ROOT / folder).rglob("*")):
            inside = set(file.parts[len(ROOT.parts) :])
            if file.is_file() and not {"__pycache__", "build", "tests"} & inside:
                yield file


def _revision() -> bytes:
    recorded = ROOT / REVISION
    return (
        recorded.read_bytes()
        if recorded.exists()
        else json.dumps(PROVENANCE["revision"]()).encode()
    )


def _digest(data: bytes) -> str:
    return "sha256=" + base64.urlsafe_b64encode(hashlib.sha256(data).digest()).decode().rstrip("=")
