"""Fly a circle with MAVSDK: `python examples/mavsdk_circle.py [CONNECTION [LOG]]`.

Needs a laboratory (`quadlab up`), the gateway (`quadlab mavlink`) and `pip install mavsdk`. LOG is
where the run is downloaded to.
"""

from __future__ import annotations

import asyncio
import math
import sys
import time

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk, System
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.log_files import LogFilesAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import FlightMode, TelemetryAsync
from mavsdk.plugins.offboard import PositionNedYaw

USUAL = "udpin://127.0.0.1:14540"
RADIUS, LAP, HEIGHT = 0.4, 6.0, 0.8  # m, s, m
PERIOD = 0.05


async def fly(system: System) -> None:
    """Arm, take off, fly a circle in offboard, and land."""
    action, offboard, telemetry = ActionAsync(system), OffboardAsync(system), TelemetryAsync(system)
    while not await telemetry.health_all_ok():
        await asyncio.sleep(PERIOD)
    print("healthy", flush=True)
    gain = await ParamAsync(system).get_param_float("C_POSITION_KP_XY")
    print(f"position gain {gain:g}", flush=True)
    await action.arm()
    await action.set_takeoff_altitude(HEIGHT)
    await action.takeoff()
    while await telemetry.flight_mode() != FlightMode.HOLD:
        await asyncio.sleep(PERIOD)
    start = (await telemetry.position_velocity_ned()).position
    print(f"hovering at {-start.down_m:.1f} m", flush=True)

    def point(turned: float) -> PositionNedYaw:
        north = start.north_m + RADIUS * math.sin(turned)
        east = start.east_m + RADIUS * (1.0 - math.cos(turned))
        return PositionNedYaw(north, east, start.down_m, 90.0)

    await offboard.set_position_ned(point(0.0))
    await offboard.start()
    began, farthest = time.monotonic(), 0.0
    while (since := time.monotonic() - began) < LAP:
        await offboard.set_position_ned(point(2.0 * math.pi * since / LAP))
        await asyncio.sleep(PERIOD)
        at = (await telemetry.position_velocity_ned()).position
        farthest = max(farthest, math.hypot(at.north_m - start.north_m, at.east_m - start.east_m))
        if await telemetry.flight_mode() != FlightMode.OFFBOARD:
            raise RuntimeError("the vehicle has left offboard flight")
    await offboard.stop()
    print(f"circle flown, up to {farthest:.2f} m away", flush=True)
    await action.land()
    while await telemetry.armed():
        await asyncio.sleep(PERIOD)
    print("landed", flush=True)


async def download(system: System, path: str) -> None:
    """Download the newest run."""
    logs = LogFilesAsync(system)
    entries = await logs.get_entries()
    async for _ in logs.download_log_file(entries[-1], path):
        pass
    print(f"downloaded {entries[-1].size_bytes} bytes of {entries[-1].date}", flush=True)


async def main(connection: str, path: str) -> None:
    ground = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await ground.add_any_connection(connection)
    system = await ground.first_autopilot(timeout_s=20.0)
    print("connected", flush=True)
    await fly(system)
    if path:
        await asyncio.sleep(2.0)  # until the station has closed the run
        await download(system, path)
    ground.destroy()


if __name__ == "__main__":
    given = (*sys.argv[1:3], "", "")[:2]
    asyncio.run(main(given[0] or USUAL, given[1]))
