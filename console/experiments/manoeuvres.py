"""Manoeuvres that several experiments fly: arming, take-off, laps, landing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from console.experiments.client import Client
from console.experiments.readings import Progress
from quadrotor.errors import RefusedError
from quadrotor.parameter_description import ParameterValue

LANDING = 30.0
"""Seconds for the landing after a calibration flight."""


def wait_ready(client: Client) -> None:
    """Wait until the vehicle is ready. Raises RefusedError."""
    client.wait_until(lambda v: v.mode == "ready", what="the vehicle to be ready", timeout=20)


def arm(client: Client) -> None:
    """Start the motors after half a second, and wait until they have settled. Raises
    RefusedError.
    """
    client.wait(0.5)
    client.arm()
    client.wait(1.0)


def take_off(client: Client, height: float) -> None:
    """Take off and wait until the vehicle hovers. Raises RefusedError."""
    client.start("take_off", height=height)
    client.wait_until(lambda v: v.behavior == "hover", what="hover after take-off", timeout=20)


def fly_laps(client: Client, what: str, patience: float, **laps: ParameterValue) -> None:
    """Fly a trajectory to its end, or brake when the experiment is to end. Raises RefusedError."""
    client.start("follow_trajectory", **laps)
    client.wait_until(
        lambda v: v.behavior == "hover" or client.finished,
        what=f"the end of {what}",
        timeout=patience,
    )
    if client.view().behavior == "follow_trajectory":  # finished before its end
        brake(client)


def brake(client: Client) -> None:
    """Brake and wait until the vehicle has stopped. Raises RefusedError."""
    client.start("brake")
    client.wait(2.0)


def land(client: Client) -> None:
    """Land and wait until the motors are off. Raises RefusedError."""
    client.start("land")
    wait_landed(client, 20)


def wait_landed(client: Client, timeout: float) -> None:
    """Wait for the motors to be off after a landing, at most `timeout` s. Raises RefusedError."""
    client.wait_until(lambda v: not v.armed, what="touch-down", timeout=timeout)
    client.wait(0.5)


def come_down(client: Client) -> None:
    """Land if in flight, and wait until the motors are off. Raises RefusedError."""
    view = client.view()
    if view.mode == "armed" and view.behavior not in ("ground", "land"):
        client.start("land")
    if view.armed and view.behavior != "ground":
        client.wait_until(lambda v: not v.armed, what="touch-down", timeout=LANDING)
    client.wait(0.5)


@contextmanager
def landing_afterwards(client: Client, step: int) -> Iterator[None]:
    """Land at the end of the block, which is the last `step`, or after a refusal within it."""
    try:
        yield
    except RefusedError:
        come_down(client)
        raise
    client.tell(Progress("It lands", step, step))
    come_down(client)
