"""Links to Crazyflies: how they are named, UDP on loopback, and a radio that is asked."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from extensions.crazyflie.board.guard import Guard
from extensions.crazyflie.crtp import radio
from extensions.crazyflie.crtp.packets import NULL, FrameReader, Packet, frame
from extensions.crazyflie.crtp.share import share
from extensions.crazyflie.crtp.udp import UdpServer
from quadlab.__main__ import main
from quadrotor.errors import LinkError
from vehicle_link.serial.links import open_port
from vehicle_link.serial.port import Port

ADDRESSES = bytes.fromhex("E7E7E7E701"), bytes.fromhex("E7E7E7E702")
PATIENCE_S = 10.0


@pytest.mark.parametrize(
    ("word", "why"),
    [
        ("udp://127.0.0.1", "give one like udp://127.0.0.1:19850 or radio://0/80/2M/E7E7E7E7E7"),
        ("udp://127.0.0.1:70000", "give one like"),
        ("usb://0", "give one like"),
        ("udp://no.such.host.invalid:19850", "is the host right?"),
        ("radio://0/126/2M/E7E7E7E7E7", "a channel of 0 to 125"),
        ("radio://0/80/3M", "250K, 1M or 2M"),
        ("radio://0/80/2M/E7E7", "ten hexadecimal digits"),
    ],
)
def test_a_link_that_is_not_one_is_refused_with_an_example(word: str, why: str) -> None:
    with pytest.raises(LinkError) as caught:
        open_port(word, 115_200)
    assert str(caught.value).startswith(f"link {word} cannot be opened")
    assert why in str(caught.value)


def test_without_a_radio_it_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    from usb import core

    monkeypatch.setattr(core, "find", lambda **_: iter(()))
    with pytest.raises(LinkError, match="no Crazyradio 0: 0 are plugged in; plug it in"):
        open_port("radio://0/80/2M/E7E7E7E7E7", 0)


def test_packets_cross_udp_both_ways_and_a_second_server_is_refused() -> None:
    line = UdpServer(0)
    port = open_port(line.link, 0)
    one, other = frame(Packet(5, 1, b"up").encode()), frame(Packet(5, 2, b"down").encode())
    try:
        port.write(one + other)
        got = b""
        while len(got) < len(one + other):  # a test that hangs here is ended by its time limit
            got += line.read()
        assert got == one + other
        line.write(other)
        got = b""
        while not got:
            got = port.read()
        assert got == other
        with pytest.raises(LinkError, match="in use; end the other Crazyflie there"):
            UdpServer(int(line.link.rpartition(":")[2]))
    finally:
        port.close()
        line.close()


class Dongle:
    """A radio with two Crazyflies on the air, each of which answers with its own address."""

    def __init__(self) -> None:
        self.address, self.channel, self.rate = b"", -1, -1
        self.heard: dict[bytes, list[bytes]] = {address: [] for address in ADDRESSES}
        self.gone = False
        self.both = threading.Event()

    def ctrl_transfer(
        self, kind: int, request: int, value: int, index: int, data: bytes, timeout: int
    ) -> None:
        if request == radio.SET_ADDRESS:
            self.address = bytes(data)
        elif request == radio.SET_CHANNEL:
            self.channel = value
        elif request == radio.SET_RATE:
            self.rate = value

    def write(self, endpoint: int, data: bytes, timeout: int) -> int:
        if self.gone:
            raise OSError(19, "No such device")
        assert (self.channel, self.rate) == (80, 2)
        self.heard[self.address].append(bytes(data))
        if all(any(one != NULL for one in packets) for packets in self.heard.values()):
            self.both.set()
        return len(data)

    def read(self, endpoint: int, size: int, timeout: int) -> Any:
        return b"\x21" + Packet(0, 0, self.address).encode()


def read_on(port: Port) -> None:
    while True:
        port.read()


@pytest.fixture
def dongle(monkeypatch: pytest.MonkeyPatch) -> Dongle:
    made = Dongle()
    monkeypatch.setattr(radio, "find_device", lambda number: made)
    monkeypatch.setattr(radio, "_RADIOS", {})
    return made


def test_one_radio_serves_two_by_their_addresses_and_tells_when_it_is_gone(dongle: Dongle) -> None:
    words = [f"radio://0/80/2M/{address.hex()}" for address in ADDRESSES]
    ports = [open_port(word, 0) for word in words]
    with pytest.raises(LinkError, match="two Crazyflies have address E7E7E7E701 on channel 80"):
        open_port(words[0], 0)
    for port, address in zip(ports, ADDRESSES, strict=True):
        port.write(frame(Packet(7, 0, address[-1:]).encode()))
    assert dongle.both.wait(PATIENCE_S)
    for port, address in zip(ports, ADDRESSES, strict=True):
        reader, got = FrameReader(), b""
        while not got:
            got = next(reader.feed(port.read()), b"")
        assert got[1:] == address
        assert Packet(7, 0, address[-1:]).encode() in dongle.heard[address]
        assert isinstance(port, radio.RadioPort)
        counts = port.counts
        assert counts.sent >= counts.acknowledged > 0
        assert counts.retries == 2 * counts.acknowledged
        assert counts.round_trips_ns > 0
    dongle.gone = True
    with pytest.raises(LinkError, match="Crazyradio 0 is gone: No such device; plug it in"):
        read_on(ports[0])


def test_a_shared_radio_serves_each_crazyflie_by_udp_until_it_is_pulled(dongle: Dongle) -> None:
    free = [UdpServer(0) for _ in ADDRESSES]
    numbers = [int(server.link.rpartition(":")[2]) for server in free]
    for server in free:
        server.close()
    words = [f"radio://0/80/2M/{address.hex()}" for address in ADDRESSES]
    ended, why = threading.Event(), []
    links = list(zip(words, numbers, strict=True))

    def shared() -> None:
        try:
            share(links, [Guard(), Guard()], ended.is_set)
        except LinkError as error:
            why.append(str(error))

    sharing = threading.Thread(target=shared)
    sharing.start()
    try:
        for number, address in zip(numbers, ADDRESSES, strict=True):
            port, reader, got = open_port(f"udp://127.0.0.1:{number}", 0), FrameReader(), b""
            while not got:
                port.write(frame(Packet(7, 0, b"1").encode()))
                got = next(reader.feed(port.read()), b"")
            assert got[1:] == address
            port.close()
        dongle.gone = True
        sharing.join(PATIENCE_S)
        assert why == ["Crazyradio 0 is gone: No such device; plug it in, start again"]
    finally:
        ended.set()
        sharing.join()


def test_a_link_or_port_given_twice_and_a_word_that_is_none_are_refused(
    capsys: pytest.CaptureFixture[str],
) -> None:
    one, two = "radio://0/80/2M/E7E7E7E701", "radio://0/80/2M/E7E7E7E702"
    for words, said in (
        ([f"{one}=19850", f"{one}=19851"], f"link {one} is given twice; give each Crazyflie"),
        ([f"{one}=19850", f"{two}=19850"], "port 19850 is given twice"),
        ([one], f"'{one}' is not LINK=PORT; give one like"),
    ):
        assert main(["crazyradio", *words]) == 2
        assert said in capsys.readouterr().err
