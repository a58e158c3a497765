"""`quadlab export fmu MODEL`: our plant, or our law, for other simulation tools."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from quadlab.option_types import Settings
from quadrotor.errors import StorageError, UsageError


@dataclass
class Export:
    """Write the simulated plant or the geometric law as an FMU, for Simulink and Modelica tools."""

    kind: Annotated[Literal["fmu"], tyro.conf.Positional]
    """what to write: fmu, for co-simulation (docs/extending/fmu_export.md)"""
    model: Annotated[Literal["plant", "law"], tyro.conf.Positional]
    """plant: rotors, rigid body, air, ground; law: the paper's controller"""
    out: Annotated[Path, tyro.conf.arg(metavar="FILE.fmu")]
    """the file to write; an existing one is replaced"""
    fmi: Literal[2, 3] = 2
    """version of the standard: 2, which most tools read, or 3, whose vectors are arrays"""
    set: Settings = ()
    """a start value other than the default, like mass=1.5 or control.position.kp_xy=6"""

    def run(self) -> int:
        if self.out.suffix != ".fmu":
            raise UsageError(f"--out {self.out}: the file must end in .fmu")
        if not self.out.parent.is_dir():
            raise StorageError(f"--out {self.out}: there is no folder {self.out.parent}; make it")
        from extensions.fmu.description import export_fmu

        export_fmu(self.model, self.set, self.out, self.fmi)
        print(self.out)
        if self.model == "law":
            name, folder = self.out.stem, self.out.parent
            print(f"fly it: quadlab fly hover --set control.law={name} --plugins {folder}")
        return 0
