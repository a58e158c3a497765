"""CRTP over a Crazyradio, by pyusb (extra `crazyflie`).

The radio is asked: each packet that goes up is acknowledged by one that comes down, or by none, and
an empty one is sent when there is nothing to send. One thread serves all Crazyflies of a radio in
turn. Not tried on a radio; requests and fields are those of Bitcraze's "Crazyradio PA USB
protocol". The link's own counters ("safelink") are not used: packets may be lost, as over UDP.
"""

from __future__ import annotations

import contextlib
import errno
import re
import socket
import threading
import time
from typing import Any, Protocol

import msgspec

from extensions.crazyflie.crtp.packets import NULL, FrameReader, frame
from quadrotor.errors import LinkError, UsageError
from vehicle_link.link_counts import LinkCounts

VENDOR, PRODUCT = 0x1915, 0x7777
SET_CHANNEL, SET_ADDRESS, SET_RATE, SET_POWER, SET_RETRIES = 1, 2, 3, 4, 6
TO_DEVICE = 0x40
"""bmRequestType of a vendor's request."""
OUT, IN = 0x01, 0x81
FULL_POWER, RETRIES = 3, 3
RATES = {"250K": 0, "1M": 1, "2M": 2}
USB_MS = 100
IDLE_S = 0.002
"""Pause after a round in which no Crazyflie answered."""
_URI = re.compile(r"radio://(\d+)/(\d{1,3})/(250K|1M|2M)(?:/([0-9A-Fa-f]{10}))?$")
DEFAULT_ADDRESS = "E7E7E7E7E7"


class Place(msgspec.Struct, frozen=True):
    """The radio address of one Crazyflie."""

    channel: int
    rate: int
    address: bytes


class Device(Protocol):
    """The part of a pyusb device that is used."""

    def ctrl_transfer(
        self, kind: int, request: int, value: int, index: int, data: bytes, timeout: int
    ) -> object: ...

    def write(self, endpoint: int, data: bytes, timeout: int) -> Any: ...

    def read(self, endpoint: int, size: int, timeout: int) -> Any: ...


def parse(word: str) -> tuple[int, Place]:
    """Return the number of the radio and the place of `radio://...`. Raises LinkError."""
    found = _URI.match(word)
    if not found or int(found[2]) > 125:
        raise LinkError(
            f"link {word} cannot be opened: give radio://NUMBER/CHANNEL/RATE/ADDRESS with a "
            "channel of 0 to 125, 250K, 1M or 2M, and ten hexadecimal digits, like "
            f"radio://0/80/2M/{DEFAULT_ADDRESS}"
        )
    address = bytes.fromhex(found[4] or DEFAULT_ADDRESS)
    return int(found[1]), Place(int(found[2]), RATES[found[3]], address)


def find_device(number: int) -> Device:
    """Return the n-th Crazyradio. Raises UsageError without pyusb, LinkError without the radio."""
    try:
        import usb.core
    except ImportError:
        raise UsageError(
            "radio:// needs pyusb, which is not installed: pip install pyusb"
        ) from None
    try:
        devices = list(usb.core.find(find_all=True, idVendor=VENDOR, idProduct=PRODUCT) or ())
    except usb.core.NoBackendError:
        raise LinkError("radio:// needs libusb: sudo apt install libusb-1.0-0") from None
    if number >= len(devices):
        raise LinkError(
            f"no Crazyradio {number}: {len(devices)} are plugged in; plug it in, or count from 0"
        )
    device: Device = devices[number]
    try:
        devices[number].set_configuration()
    except usb.core.USBError as error:
        raise LinkError(
            f"Crazyradio {number} cannot be used: {error.strerror}; end other programs that use "
            "it, or install the udev rule of docs/boards/crazyflie.md"
        ) from None
    return device


class Radio:
    """One Crazyradio, shared by the Crazyflies it serves.

    Attributes:
        problem: why it is gone, "" while it works.
        retries: transmissions of the newest packet beyond the first.
    """

    def __init__(self, device: Device, name: str) -> None:
        self._device, self._name = device, name
        self._tuned: Place | None = None
        self._ports: dict[Place, RadioPort] = {}
        self._lock = threading.Lock()
        self.problem = ""
        self.retries = 0
        self._set(SET_POWER, FULL_POWER)
        self._set(SET_RETRIES, RETRIES)
        threading.Thread(target=self._serve, name=name, daemon=True).start()

    def add(self, place: Place) -> RadioPort:
        """Return the port of a Crazyflie. Raises LinkError for one that is served already."""
        with self._lock:
            if place in self._ports:
                raise LinkError(
                    f"two Crazyflies have {self._ports[place].link}: give each its own with "
                    "cfclient"
                )
            port = self._ports[place] = RadioPort(self, place)
        return port

    def remove(self, place: Place) -> None:
        with self._lock:
            self._ports.pop(place, None)

    def exchange(self, place: Place, packet: bytes) -> bytes | None:
        """Send a packet; return what came with the acknowledgement, None without one."""
        tuned = self._tuned
        if tuned is None or tuned.channel != place.channel:
            self._set(SET_CHANNEL, place.channel)
        if tuned is None or tuned.rate != place.rate:
            self._set(SET_RATE, place.rate)
        if tuned is None or tuned.address != place.address:
            self._set(SET_ADDRESS, 0, place.address)
        self._tuned = place
        try:
            self._device.write(OUT, packet, USB_MS)
            answer = bytes(self._device.read(IN, 64, USB_MS))
        except OSError as error:
            if error.errno != errno.ETIMEDOUT:
                raise
            return None
        self.retries = answer[0] >> 4 if answer else 0
        return answer[1:] if answer and answer[0] & 1 else None

    def _set(self, request: int, value: int, data: bytes = b"") -> None:
        self._device.ctrl_transfer(TO_DEVICE, request, value, 0, data, USB_MS)

    def _serve(self) -> None:
        pause = threading.Event()
        while not self.problem:
            with self._lock:
                ports = list(self._ports.values())
            try:
                answered = [port.poll() for port in ports]
            except OSError as error:  # of pyusb, too: its errors are OSErrors
                self.problem = f"{self._name} is gone: {error.strerror}; plug it in, start again"
                for port in ports:
                    port.wake()
                break
            if not any(answered):
                pause.wait(IDLE_S)


class RadioPort:
    """The port of one Crazyflie, which carries frames.

    Attributes:
        counts: its exchanges, each with one packet up.
    """

    def __init__(self, radio: Radio, place: Place) -> None:
        self._radio, self._place = radio, place
        self.link = f"address {place.address.hex().upper()} on channel {place.channel}"
        self.counts = LinkCounts()
        self._frames = FrameReader()
        self._up: list[bytes] = []
        self._near, self._far = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
        self._near.setblocking(False)
        self._far.setblocking(False)

    def poll(self) -> bool:
        """Exchange one packet; return whether it was answered. Called by the radio's thread."""
        packet = self._up.pop(0) if self._up else NULL
        began_ns = time.monotonic_ns()
        answer = self._radio.exchange(self._place, packet)
        counts = self.counts
        counts.sent += 1
        counts.waiting = len(self._up)
        if answer is not None:
            counts.acknowledged += 1
            counts.answered += 1
            counts.round_trips_ns += time.monotonic_ns() - began_ns
            counts.retries += self._radio.retries
        if answer:
            with contextlib.suppress(OSError):  # nobody reads, or it was closed meanwhile
                self._far.send(frame(answer))
        return answer is not None

    def wake(self) -> None:
        """Make the reader look at once."""
        self._far.close()

    def read(self) -> bytes:
        if self._radio.problem:
            raise LinkError(self._radio.problem)
        with contextlib.suppress(BlockingIOError):
            return self._near.recv(65536)
        return b""

    def write(self, data: bytes) -> None:
        if self._radio.problem:
            raise LinkError(self._radio.problem)
        self._up += self._frames.feed(data)

    def fileno(self) -> int:
        return self._near.fileno()

    def close(self) -> None:
        self._radio.remove(self._place)
        self._near.close()
        self._far.close()


_RADIOS: dict[int, Radio] = {}


def open_radio(word: str) -> RadioPort:
    """Return the port of `radio://...`. Raises LinkError, UsageError."""
    number, place = parse(word)
    if number not in _RADIOS or _RADIOS[number].problem:
        _RADIOS[number] = Radio(find_device(number), f"Crazyradio {number}")
    return _RADIOS[number].add(place)
