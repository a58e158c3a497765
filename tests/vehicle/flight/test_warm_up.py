"""After the warm-up nothing has to be compiled or loaded from the compiler's cache."""

from __future__ import annotations

import subprocess
import sys

from quadrotor.checkout import ROOT

# It runs in a separate process: in this one other tests would have compiled everything already.
PROGRAM = """
import gc
from types import SimpleNamespace
from numba.core.dispatcher import Dispatcher
from quadlab.simulated.meeting import Meeting
from quadlab.simulated.neighbours import Neighbours
from vehicle import mailbox
from vehicle.flight.kernels import LATER
from vehicle.flight.warm_up import warm_up
from vehicle.boards.mikrokopter.microcontroller import Microcontroller
from vehicle.modes import Mode
from vehicle.parameters import new_parameters
from vehicle.simulator.parameters import SimulatorParameters
from quadrotor.records import pose_sample
from vehicle.simulator.simulated_vehicle import SimulatedVehicle
from vehicle.flight.stack import FlightStack

simulated = SimulatedVehicle(SimulatorParameters())
simulated.step()
simulated.step()
meeting = Meeting(Meeting.new_files(1, 1), 1, [0])
log = SimpleNamespace(message=None)
Neighbours(meeting, lambda: None, ["quad1"], 0, simulated, log).step()  # as in a fleet
assert warm_up() == [], "a behavior of the warm-up was refused"
for _, load in LATER.values():
    load()
laws = [o for o in gc.get_objects() if isinstance(o, Dispatcher)]
anew = [law.py_func.__qualname__ for law in laws if "_entry" in vars(law)]
assert not anew, f"compiled at every start, for Python called an inner function: {anew}"
ready = {law: len(law.overloads) for law in laws}
assert sum(ready.values()) > 10

parameters = new_parameters()
parameters.safety.gyro_samples = 50
stack, mcu, motor_state = FlightStack(parameters), Microcontroller(simulated.ports, 0), None

def fly(seconds):
    global motor_state
    for k in range(int(seconds * 500)):
        simulated.step()
        now = simulated.stamp_ns
        stack.measure(mailbox.Heartbeat(now))
        stack.measure(mailbox.Joy(now, (0.2, 0.1, 0.0, -0.1), k % 1000 < 500))
        if k % 5 == 0:
            position = tuple(simulated.truth["position_w"][0].tolist())
            quaternion = tuple(simulated.truth["quaternion_wb"][0].tolist())
            stack.measure(pose_sample(now, position, quaternion))
        for sample in mcu.receive():
            motors = stack.tick(sample)
            if stack.modes.motor_state_wanted is not motor_state:
                motor_state = stack.modes.motor_state_wanted
                mcu.set_motor_state(motor_state)
            if motors is not None:
                mcu.command(motors)
        mcu.service(now * 1e-9)

def ask(command):
    reply = stack.handle(command)
    assert reply.accepted, reply.reason

fly(1.0)
ask(mailbox.Arm("", "test"))
fly(0.5)
for name, arguments, seconds in (
    ("take_off", {"height": 1.0}, 5.0),
    ("fly_to", {"x": 0.5, "y": 0.3, "z": 1.2, "yaw": 0.5}, 4.0),
    ("follow_trajectory", {}, 3.0),
    ("brake", {}, 3.0),
    ("velocity", {}, 2.0),
    ("hover", {}, 2.0),
    ("land", {}, 8.0),
):
    ask(mailbox.StartBehavior("", "test", name, arguments))
    fly(seconds)
assert stack.mode is Mode.READY, stack.mode
late = [law.py_func.__qualname__ for law in laws if len(law.overloads) > ready[law]]
late += [o.py_func.__qualname__ for o in gc.get_objects() if isinstance(o, Dispatcher)
         and o not in ready and o.overloads]
assert not late, f"compiled or loaded in flight: {late}"
"""


def test_nothing_compiles_in_flight() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr.splitlines()[-1]
