"""All faults that `simulator.faults` takes."""

from __future__ import annotations

from bearing_sim.faults.fault import OF_SIMULATOR, Catalogue
from vehicle.simulator.faults.body import BODY
from vehicle.simulator.faults.imu import IMU
from vehicle.simulator.faults.supply import SUPPLY
from vehicle.simulator.faults.truth import VehicleFault
from vehicle.simulator.faults.world import WORLD

VEHICLE: tuple[type[VehicleFault], ...] = (*IMU, *SUPPLY, *BODY, *WORLD)
CATALOGUE = Catalogue(OF_SIMULATOR, {one.name: one for one in VEHICLE})
