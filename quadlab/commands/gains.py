"""`quadlab gains`: the margins of the named gain sets, or of any other set."""

from __future__ import annotations

from dataclasses import dataclass

from quadlab.option_types import Settings
from quadlab.settings import parse_settings


@dataclass
class Gains:
    """Print the phase margins of the named gain sets, and of one made with --set."""

    set: Settings = ()
    """a gain or model parameter, like control.position.kp_xy=9, or control.preset=stiff"""

    def run(self) -> int:
        from control.margins import LOW_MARGIN, margins, smallest
        from control.presets import PRESETS, preset
        from vehicle.parameters import new_parameters

        parameters = new_parameters()
        parse_settings(parameters, self.set)
        lag = parameters.model.motor_time_constant
        chosen = [(name, preset(name)) for name in PRESETS]
        if self.set:
            chosen = [("this set", parameters.control)]
        loops = [one.loop for one in margins(chosen[0][1], lag)]
        width = max(len(name) for name, _ in chosen)
        print(f"phase margin (and delay tolerated) with motors of {lag:g} s")
        print(" " * width + "".join(f"{loop:>16}" for loop in loops))
        for name, gains in chosen:
            found = margins(gains, lag)
            cells = (f"{one.phase:.0f}° ({1e3 * one.delay:.0f} ms)" for one in found)
            print(f"{name:{width}}" + "".join(f"{cell:>16}" for cell in cells))
            worst = smallest(found)
            if worst.phase < LOW_MARGIN:
                verdict = "is unstable" if worst.phase < 0.0 else "is about to oscillate"
                print(f"  do not fly it: the {worst.loop} loop {verdict}")
        print("set one with --set control.preset=NAME; further --set words change it")
        return 0
