"""FMUs for tests: made once, then with changes to their description."""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path

MANIFEST = "modelDescription.xml"


def renamed(path: Path, names: Mapping[str, str], folder: Path) -> Path:
    """Return a copy of an FMU in this folder, with other names for some of its variables."""
    with zipfile.ZipFile(path) as file:
        files = {name: file.read(name) for name in file.namelist()}
    text = files[MANIFEST].decode()
    for old, new in names.items():
        assert f'name="{old}"' in text
        text = text.replace(f'name="{old}"', f'name="{new}"')
    made = folder / path.name
    with zipfile.ZipFile(made, "w") as file:
        for name, data in (files | {MANIFEST: text.encode()}).items():
            file.writestr(name, data)
    return made
