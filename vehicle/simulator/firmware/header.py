"""Write the firmware's constants for C: `python -m vehicle.simulator.firmware.header`."""

from __future__ import annotations

from quadrotor.checkout import ROOT
from quadrotor.motor_state import MotorState
from vehicle.simulator.firmware import constants, firmware, hovering
from vehicle_link.serial import ids

PATH = ROOT / "firmware" / "core" / "constants.h"
_ENUMS = {"ID": ids.Id, "STATE": MotorState, "MODE": ids.FlightControlMode}
_OPENING = """/* Written by `python -m vehicle.simulator.firmware.header`: edit constants.py there.
 * Units and sources of the numbers are in that file. */
#ifndef CONSTANTS_H
#define CONSTANTS_H

#include <stdint.h>

"""


def header() -> str:
    """Return the text of the header: ids, and the constants of the supervision and of the laws."""
    numbers = {f"{prefix}_{one.name}": int(one) for prefix, enum in _ENUMS.items() for one in enum}
    for module in (firmware, constants):
        found = {name: value for name, value in vars(module).items() if isinstance(value, int)}
        numbers |= {n: int(v) for n, v in found.items() if n.isupper() and not n.startswith("_")}
    numbers |= {f"DEFAULT_{id.name}": value for id, value in hovering.DEFAULT_GAINS.items()}
    laws = vars(constants)
    lines = [
        f"#define {name} " + (f"INT32_C({value})" if name in laws or value > 32767 else f"{value}")
        for name, value in numbers.items()
    ]
    mirror = ", ".join(str(int(id)) for id in ids.MIRROR)
    return _OPENING + "\n".join([*lines, f"#define DEFAULT_MIRROR {{{mirror}}}", "", "#endif", ""])


if __name__ == "__main__":
    PATH.write_text(header())
