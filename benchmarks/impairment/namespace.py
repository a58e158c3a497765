"""Network namespaces that live as long as a process holds them, each with one TUN device.

Nothing is left in the system: a namespace is a file descriptor, and so is its device. Needs root,
or a kernel that allows any user to be root in a separate user namespace.
"""

from __future__ import annotations

import ctypes
import fcntl
import os
import socket
import struct
import subprocess
from typing import NamedTuple

from quadrotor.errors import StorageError

CLONE_NEWNET = 0x40000000
TUNSETIFF = 0x400454CA
IFF_TUN, IFF_NO_PI = 0x0001, 0x1000
DEVICE = "wire0"
MTU = 1500
_libc = ctypes.CDLL(None, use_errno=True)


class End(NamedTuple):
    """One end of a link.

    Attributes:
        device, namespace: file descriptors.
        address: of the device, IPv4.
    """

    device: int
    namespace: int
    address: str

    def close(self) -> None:
        os.close(self.device)
        os.close(self.namespace)


def make_end(address: str) -> End:
    """Make an end with this address. Raises StorageError with the reason if that is not allowed."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    with ours, theirs:
        child = os.fork()
        if child == 0:
            _make(theirs, address)
        said, descriptors, _, _ = socket.recv_fds(ours, 400, 2)
        os.waitpid(child, 0)
    if said != b"made":
        raise StorageError(
            f"no network namespace can be made here ({said.decode()}); it needs root, /dev/net/tun "
            "and the programs ip and nsenter"
        )
    device, namespace = descriptors
    os.set_blocking(device, False)
    return End(device, namespace, address)


def _make(theirs: socket.socket, address: str) -> None:
    """Make the namespace in a child process; never returns."""
    try:
        _call(_libc.unshare(CLONE_NEWNET), "unshare")
        device = os.open("/dev/net/tun", os.O_RDWR)
        fcntl.ioctl(device, TUNSETIFF, struct.pack("16sH22x", DEVICE.encode(), IFF_TUN | IFF_NO_PI))
        for words in (
            "link set lo up",
            f"addr add {address}/24 dev {DEVICE}",
            f"link set {DEVICE} mtu {MTU} txqueuelen 1000 up",
        ):
            subprocess.run(["ip", *words.split()], check=True, capture_output=True)
        namespace = os.open("/proc/self/ns/net", os.O_RDONLY)
        socket.send_fds(theirs, [b"made"], [device, namespace])
    except BaseException as error:  # any error is reported to the parent
        theirs.send(str(error).encode()[:300] or b"failed")
    os._exit(0)


def _call(result: int, what: str) -> None:
    if result != 0:
        number = ctypes.get_errno()
        raise OSError(number, f"{what}: {os.strerror(number)}")
