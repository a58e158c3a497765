"""The services the vehicle offers on the link: commands, parameters, time, name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from quadrotor.errors import QuadlabError
from quadrotor.parameters import ParameterValue
from vehicle import mailbox
from vehicle.comms_clock import VehicleClock
from vehicle.comms_commands import FlightMailbox, ParameterMirror
from vehicle_link.idempotent import RequestCache
from vehicle_link.messages import Message, new
from vehicle_link.node import Node
from vehicle_link.parameter_messages import from_parameters, to_parameters
from vehicle_link.parameter_service import serve_parameters
from vehicle_link.topics import SERVICES

ROLE = "vehicle"
