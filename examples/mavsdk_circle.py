"""Fly a circle with MAVSDK: `python examples/mavsdk_circle.py CONNECTION LOG`.

Needs `quadlab up`, `quadlab mavlink` and `pip install mavsdk`; the run is downloaded to LOG.
"""

import asyncio
import math
import sys

from mavsdk.asyncio import ComponentType, Configuration, Mavsdk, System
from mavsdk.asyncio.plugins.action import ActionAsync
from mavsdk.asyncio.plugins.log_files import LogFilesAsync
from mavsdk.asyncio.plugins.offboard import OffboardAsync, PositionNedYaw
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import FlightMode, TelemetryAsync

RADIUS, PERIOD = 0.4, 0.05  # m, s


async def fly(system: System) -> None:
    """Arm, take off, fly a circle in offboard, and land."""
    action, offboard, telemetry = ActionAsync(system), OffboardAsync(system), TelemetryAsync(system)
    while not await telemetry.health_all_ok():
        await asyncio.sleep(PERIOD)
    print("position gain", await ParamAsync(system).get_param_float("C_POSITION_KP_XY"), flush=True)
    await action.arm()
    await action.set_takeoff_altitude(0.8)
    await action.takeoff()
    while await telemetry.flight_mode() != FlightMode.HOLD:
        await asyncio.sleep(PERIOD)
    await asyncio.sleep(1.0)  # until it rests
    start = (await telemetry.position_velocity_ned()).position
    await offboard.set_position_ned(PositionNedYaw(start.north_m, start.east_m, start.down_m, 90.0))
    await offboard.start()
    farthest = 0.0
    for turned in map(math.radians, range(0, 360, 3)):
        north = start.north_m + RADIUS * math.sin(turned)
        east = start.east_m + RADIUS * (1.0 - math.cos(turned))
        await offboard.set_position_ned(PositionNedYaw(north, east, start.down_m, 90.0))
        await asyncio.sleep(PERIOD)
        at = (await telemetry.position_velocity_ned()).position
        farthest = max(farthest, math.hypot(at.north_m - start.north_m, at.east_m - start.east_m))
    await offboard.stop()
    print(f"circle flown, up to {farthest:.2f} m away", flush=True)
    await action.land()
    while await telemetry.armed():
        await asyncio.sleep(PERIOD)


async def main(connection: str, path: str) -> None:
    ground = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    await ground.add_any_connection(connection)
    await fly(system := await ground.first_autopilot(timeout_s=20.0))
    await asyncio.sleep(2.0)  # until the station has closed the run
    logs = LogFilesAsync(system)
    [_ async for _ in logs.download_log_file((await logs.get_entries())[-1], path)]
    ground.destroy()


asyncio.run(main(*sys.argv[1:3]))
