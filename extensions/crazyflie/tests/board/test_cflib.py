"""Bitcraze's own client, cflib, judges the simulated Crazyflie over UDP."""

from __future__ import annotations

import itertools
import math
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from cflib import crtp

from extensions.crazyflie.board.messages import Info
from extensions.crazyflie.crtp.udp import UdpServer
from extensions.crazyflie.simulated.variables import PARAMETERS
from extensions.crazyflie.tests.board.bench import RestingCrazyflie

PATIENCE_S = 20.0
GAIN = "pid_rate.roll_kp"


class Served:
    """A resting Crazyflie behind UDP, in real time."""

    def __init__(self) -> None:
        self.firmware, self.line = RestingCrazyflie(), UdpServer(0)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.wait(0.001):
            self.firmware.receive(0, self.line.read())
            self.firmware.period((0, 0, 0, 0))
            self.line.write(self.firmware.next_data()[1])

    def until(self, condition: Callable[[], bool]) -> None:
        ended = threading.Event()
        for _ in range(round(PATIENCE_S / 0.01)):
            if condition():
                return
            ended.wait(0.01)
        raise AssertionError(f"not within {PATIENCE_S:g} s")

    def close(self) -> None:
        self._stop.set()
        self._thread.join()
        self.line.close()


@pytest.fixture
def served() -> Iterator[Served]:
    made = Served()
    yield made
    made.close()


def test_it_connects_reads_writes_logs_flies_and_stops(served: Served, tmp_path: Path) -> None:
    from cflib.crazyflie import Crazyflie
    from cflib.crazyflie.log import LogConfig
    from cflib.crazyflie.syncCrazyflie import SyncCrazyflie

    crtp.init_drivers()
    firmware = served.firmware
    with SyncCrazyflie(served.line.link, cf=Crazyflie(rw_cache=str(tmp_path))) as connected:
        client: Any = connected.cf
        assert client.platform.get_protocol_version() == 12
        names = {f"{group}.{name}" for group, of in client.param.toc.toc.items() for name in of}
        assert names == set(PARAMETERS)
        client.param.set_value(GAIN, 300.5)
        served.until(lambda: client.param.get_value(GAIN) == "300.5")
        assert firmware.parameters.values[GAIN] == 300.5

        log = LogConfig("imu", 10)
        for name in ("acc.z", "gyro.x", "stateEstimate.pitch", "pm.vbat", "supervisor.info"):
            log.add_variable(name)
        rows: list[tuple[int, dict[str, float]]] = []
        log.data_received_cb.add_callback(lambda stamp, row, _: rows.append((stamp, row)))
        client.log.add_config(log)
        log.start()
        served.until(lambda: len(rows) >= 20)
        stamps = [stamp for stamp, _ in rows]
        assert {b - a for a, b in itertools.pairwise(stamps)} == {10}
        assert rows[-1][1]["acc.z"] == pytest.approx(1.0, abs=0.01)
        assert rows[-1][1]["pm.vbat"] == pytest.approx(4.1)

        client.supervisor.send_arming_request(True)
        served.until(lambda: int(rows[-1][1]["supervisor.info"]) & Info.ARMED != 0)
        client.loc.send_extpose([0.5, -0.2, 0.0], [0.0, 0.0, math.sin(0.1), math.cos(0.1)])
        client.param.set_value("stabilizer.estimator", 2)

        # Full roll rate to the right raises the left motor; its thrust is above the right one's.
        def roll_on() -> bool:
            client.commander.send_setpoint_manual(50.0, 0.0, 0.0, 50.0, True)
            front, left, rear, right = firmware.references
            return left > max(front, rear) > right > 0.0

        served.until(roll_on)
        assert client.supervisor.is_flying
        client.supervisor.send_emergency_stop()
        served.until(lambda: not any(firmware.references))
        served.until(lambda: int(rows[-1][1]["supervisor.info"]) & Info.LOCKED != 0)
