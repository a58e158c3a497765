"""Figures of the vibration: spectra of the inertial sensors in hover, and over the whole flight."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from console.evaluation.spectrum import evenly, rotor_frequency, spectrogram
from console.plots import AXES, COLORS, DASHED, finish, grid, line, styled
from console.reports.content import Picture
from console.reports.flight import Flight
from console.reports.judgement import Judgement
from console.reports.run_log import RunLog
from extensions.identification.vibration.evaluation import LOWEST, UNITS, Vibration, read_vibration
from extensions.identification.vibration.lines import BLADES
from flight_log.fields import FORCE, RATE, THRUSTS
from quadrotor.constants import MOTORS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RANGE = 40.0
"""Range of a spectrogram, in dB below its highest value."""


def vibration(log: RunLog, flight: Flight, judged: Judgement) -> list[Picture]:
    """Return spectra with the proposed noise and the rotors' frequencies, and spectrograms."""
    found = read_vibration(log.path, log.vehicle)
    return [
        Picture(
            "Spectra",
            "Density of specific force and angular velocity in hover; the noise proposed is the "
            "floor between the lines of the rotors.",
            "Density over frequency of both sensors' three axes, with the rotors' frequencies.",
            4.4,
            styled(lambda figure: _spectra(figure, found)),
        ),
        Picture(
            "Spectrograms",
            "Mean density of the three axes over time, with the rotors' frequencies.",
            "Frequency over time of both sensors, dark where the density is high.",
            4.4,
            styled(lambda figure: _spectrograms(figure, log)),
        ),
    ]


def _spectra(figure: Figure, found: Vibration) -> None:
    axes = grid(figure, 2)[:, 0]
    for axis, (name, one) in zip(axes, found.sensors.items(), strict=True):
        for k, label in enumerate(AXES):
            root = np.sqrt(0.5 * one.density[:, k])
            axis.semilogy(one.frequency[1:], root[1:], color=COLORS[k], label=label, linewidth=0.8)
        axis.axhline(one.noise, **DASHED, label="proposed")
        for order in (1, BLADES):
            axis.axvspan(
                order * found.rotors.min() - 1.0,
                order * found.rotors.max() + 1.0,
                color="#f2e6c9",
                zorder=0,
                label="rotors and blades" if order == 1 else None,
            )
        axis.axvline(LOWEST, color="#bdbdbd", linewidth=0.8)
        finish(axis, f"{name} in hover", f"{UNITS[name][0]}/√Hz")
    axes[-1].set_xlim(0.0, found.rate / 2.0)
    axes[-1].set_xlabel("Hz")


def _spectrograms(figure: Figure, log: RunLog) -> None:
    imu, actuators = log.topics["imu"], log.topics["actuators"]
    rotors = rotor_frequency(actuators.rows(THRUSTS))
    axes = grid(figure, 2)[:, 0]
    for axis, (name, (unit, factor)), names in zip(axes, UNITS.items(), (FORCE, RATE), strict=True):
        rate, values = evenly(imu.time, factor * imu.rows(names))
        time, frequency, density = spectrogram(rate, values)
        level = 10.0 * np.log10(np.maximum(density.mean(axis=1), 1e-12))
        top = float(level[frequency >= LOWEST].max())
        look = {"cmap": "Greys", "vmin": top - RANGE, "vmax": top, "rasterized": True}
        axis.pcolormesh(time + imu.time[0], frequency, level, **look)
        for k, motor in enumerate(MOTORS):
            turning = np.where(rotors[:, k] > 0.0, rotors[:, k], np.nan)
            line(axis, actuators.time, turning, color=COLORS[k], linewidth=0.7, label=motor)
        axis.grid(False)
        axis.set_ylim(0.0, rate / 2.0)
        finish(axis, f"{name}, {RANGE:.0f} dB below its highest ({unit})", "Hz")
    axes[-1].set_xlabel("s (coloured: turns of the rotors, by their thrust)")
