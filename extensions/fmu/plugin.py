"""A plugin from an FMU (FMI 2 or 3, co-simulation), run by fmpy in the plugin's own process.

Its inputs and outputs are named as the fields of the contract. A vector is an array of the same
size (FMI 3), or numbers `NAME[1]`, `NAME[2]`, … as Simulink and Modelica export them, of a table
`NAME[1,1]`, `NAME[1,2]`, … Inputs that the FMU does not have are not set. It is unpacked next to
its file.
"""

from __future__ import annotations

import math
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from extensions.fmu.parameters import check_size, declared_by, kind_of
from quadrotor.errors import RefusedError, UsageError
from quadrotor.parameter_description import ParameterValue
from quadrotor.parameters import Parameters
from vehicle.plugins.contract import Array, Contract, Field, names_of

EXTRA = "scripts/setup fmu, or pip install 'quadlab[fmu]'"


class FmuPlugin:
    """A plugin whose step is one of an FMU; it is instantiated again by each reset.

    Attributes:
        parameters: its tunable parameters, with the FMU's names but for signs.

    Raises UsageError for a file that is not such a plugin, with what it has and what it needs.
    """

    def __init__(self, contract: Contract, path: Path) -> None:
        try:
            import fmpy
        except ImportError:
            raise UsageError(f"{path.name}: FMUs need the package fmpy; run {EXTRA}") from None
        self._name = path.name
        check_size(path)
        try:
            self._description = fmpy.read_model_description(str(path))
            self._folder = str(path.with_name(f".{path.stem}.unpacked"))
            shutil.rmtree(self._folder, ignore_errors=True)
            fmpy.extract(str(path), self._folder)
        except Exception as error:  # whatever fmpy finds wrong in somebody's file
            why = " ".join(str(error).split())
            raise UsageError(f"{path.name} is not an FMU that fmpy can read: {why}") from None
        if self._description.coSimulation is None:
            raise UsageError(f"{path.name}: it has no co-simulation; export it as such")
        variables = {one.name: one for one in self._description.modelVariables}
        inputs = {n: v for n, v in variables.items() if v.causality == "input"}
        outputs = {n: v for n, v in variables.items() if v.causality == "output"}
        allowed, answers = contract.input_fields, contract.output_fields[1:]
        self._inputs = [(f, r) for f in allowed if (r := _references(f, inputs))]
        known = {n for f in allowed for n in names_of(f)} | {f.name for f in allowed}
        unknown = sorted(inputs.keys() - known)
        if unknown:
            raise UsageError(
                f"{path.name}: unknown inputs {', '.join(unknown)}; allowed are "
                f"{', '.join(f.name for f in allowed)}"
            )
        self._outputs = [(f, _references(f, outputs)) for f in answers]
        self._default = contract.optional
        if any(not found and f.name not in self._default for f, found in self._outputs):
            *first, last = [_words(f) for f in answers if f.name not in self._default]
            raise UsageError(
                f"{path.name}: as {contract.kind} it needs the outputs {', '.join(first)} and "
                f"{last}, and has {', '.join(outputs) or 'none'}"
            )
        own, self._tunable = declared_by(path)
        self.parameters = own or Parameters()
        self._started: dict[str, ParameterValue] = dict(self.parameters)
        self._instance: Any = None
        self.reset()

    def reset(self, x: object = None) -> None:
        """Begin again from the FMU's own start values; the next `step` gets x."""
        from fmpy.simulation import instantiate_fmu

        self.close()
        try:
            fmu = self._instance = instantiate_fmu(self._folder, self._description, "CoSimulation")
            if hasattr(fmu, "setupExperiment"):
                fmu.setupExperiment(startTime=0.0)
            fmu.enterInitializationMode()
            fmu.exitInitializationMode()
        except Exception as error:
            why = " ".join(str(error).split())
            raise UsageError(f"{self._name} does not start on this computer: {why}") from None
        # FMI 2 calls a double a Real, FMI 3 a Float64.
        fmi3 = self._description.fmiVersion.startswith("3")
        self._set = fmu.setFloat64 if fmi3 else fmu.setReal
        self._get = fmu.getFloat64 if fmi3 else fmu.getReal
        self._written = dict(self._started)
        self._time = 0.0

    def step(self, x: Any) -> tuple[Any, ...]:
        """Return the outputs of the contract but for `time`, after one step of x.dt."""
        for field, references in self._inputs:
            self._set(references, np.ravel(getattr(x, field.name)).tolist())
        if self._tunable and vars(self.parameters) != self._written:
            self._tune()
        status = self._instance.doStep(self._time, x.dt)
        if isinstance(status, tuple) and status[1]:
            raise RefusedError(f"{self._name} ended its simulation at {self._time:.3f} s")
        self._time += x.dt
        return tuple(self._read(field, references) for field, references in self._outputs)

    def close(self) -> None:
        """Free the instance, if there is one."""
        if self._instance is not None:
            self._instance.freeInstance()
            self._instance = None

    def _tune(self) -> None:
        """Set the parameters that have changed."""
        for name, value in self.parameters:
            if value != self._written[name]:
                reference, kind = self._tunable[name]
                getattr(self._instance, f"set{kind}")([reference], [value])
                self._written[name] = value

    def _read(self, field: Field, references: list[int]) -> float | Array:
        if not references:
            return np.full(field.size, self._default[field.name])
        if len(references) == field.size:
            numbers = np.array(self._get(references), float)
        else:  # an array of FMI 3
            numbers = np.array(self._get(references, nValues=field.size), float)
        return numbers if field.size > 1 else float(numbers[0])


def _words(field: Field) -> str:
    """Return the names of a field's numbers: `torque_b[1] to torque_b[3]`."""
    names = names_of(field)
    return names[0] if len(names) == 1 else f"{names[0]} to {names[-1]}"


def _references(field: Field, variables: dict[str, Any]) -> list[int]:
    """Return the value references of a field, none when the FMU has not all of it.

    Raises UsageError for an array of another size.
    """
    whole = variables.get(field.name)
    if whole is None:
        numbers = [variables.get(name) for name in names_of(field)]
        return [one.valueReference for one in numbers if one is not None] if all(numbers) else []
    size = math.prod(int(d.start) for d in whole.dimensions if d.start) if whole.dimensions else 1
    if size != field.size:
        raise UsageError(f"{field.name} has {size} numbers in the FMU, expected {field.size}")
    return [whole.valueReference]


class Fmu:
    """Files of FMI 2 and 3 as a format of plugins (`vehicle.plugins.formats.Format`)."""

    def kind_of(self, path: Path) -> str:
        """Return "estimator" for an FMU that answers an attitude and no thrust, else "law"."""
        return kind_of(path)

    def declared(self, path: Path) -> Parameters | None:
        """Return the tunable parameters of an FMU. Raises UsageError."""
        return declared_by(path)[0]

    def load(self, contract: Contract, path: Path) -> FmuPlugin:
        """Return the plugin that an FMU is. Raises UsageError."""
        return FmuPlugin(contract, path)


FORMAT = Fmu()
