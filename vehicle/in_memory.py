"""The flight process of a simulated vehicle inside it, for rates beyond those of serial ports.

It is run as `python -m vehicle.in_memory CONFIG` by vehicle.processes.parent, in place of
vehicle.flight.process, where there are no ports.
"""

from __future__ import annotations

import sys

from vehicle.flight.process import main
from vehicle.simulator.in_process import InProcessRobot

if __name__ == "__main__":
    sys.exit(main(sys.argv[1], InProcessRobot))
