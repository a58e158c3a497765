"""A check that a port of this computer is free."""

from __future__ import annotations

import socket

from quadrotor.errors import UsageError


def require_free(
    what: str, port: int, kind: socket.SocketKind, option: str, host: str = "127.0.0.1"
) -> None:
    """Check that `port` of `what` is free. Raises UsageError, which names `option`."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, kind) as probe:
        if kind == socket.SOCK_STREAM:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            raise UsageError(
                f"port {port} of the {what} cannot be used ({error.strerror}); "
                f"stop what uses it or choose another with {option}"
            ) from None
