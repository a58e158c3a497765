"""A serial device, and why one cannot be opened."""

from __future__ import annotations

import errno
import grp
import os
import termios
from pathlib import Path

import serial

from vehicle_link.serial.port import BAUD_RATE, BUFFER, PortError, PortProblem

NO_DEVICE = "not a serial device; `quadlab vehicle --find` looks for those there are"
READ_AND_WRITE = 0o060
"""Permission bits of the file's group."""
_CHUNKS = 16  # most buffers to read at once: a device that floods must not block the reader


class SerialPort:
    """A serial device, 8N1, opened exclusively; input that was waiting is discarded.

    `dropped` counts frames that did not fit into the kernel's output buffer.

    Raises PortError when the device cannot be opened.
    """

    def __init__(self, path: Path | str, baud_rate: int = BAUD_RATE) -> None:
        self.path = str(path)
        self.dropped = 0
        try:
            self._serial = serial.Serial(
                self.path, baud_rate, timeout=0, write_timeout=0, exclusive=True
            )
            self._fd: int = self._serial.fileno()
            # pyserial sets VMIN = 0, with which "nothing yet" and "line lost" look the same.
            attributes = termios.tcgetattr(self._fd)
            attributes[6][termios.VMIN] = 1
            termios.tcsetattr(self._fd, termios.TCSANOW, attributes)
        except (serial.SerialException, OSError, termios.error) as error:
            raise _refused(self.path, error) from None

    def read(self) -> bytes:
        data = self._read_chunk()
        if len(data) < BUFFER:
            return data
        parts = [data]
        while len(parts[-1]) == BUFFER and len(parts) < _CHUNKS:
            parts.append(self._read_chunk())
        return b"".join(parts)

    def _read_chunk(self) -> bytes:
        try:
            data = os.read(self._fd, BUFFER)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise self._gone(error) from None
        if not data:
            raise self._gone(OSError(errno.EIO, "the other end hung up"))
        return data

    def write(self, data: bytes) -> None:
        try:
            written = os.write(self._fd, data)
        except BlockingIOError:
            written = 0
        except OSError as error:
            raise self._gone(error) from None
        if written < len(data):
            self.dropped += 1

    def fileno(self) -> int:
        return self._fd

    def close(self) -> None:
        self._serial.close()

    def _gone(self, error: OSError) -> PortError:
        return PortError(
            PortProblem.UNPLUGGED,
            self.path,
            f"{error.strerror}; plug it in (or start `quadlab simulator`) "
            "and start the vehicle again",
        )


_PROBLEMS = {
    errno.ENOENT: PortProblem.MISSING,
    errno.ENXIO: PortProblem.MISSING,
    errno.ENODEV: PortProblem.MISSING,
    errno.EAGAIN: PortProblem.BUSY,
    errno.EBUSY: PortProblem.BUSY,
    errno.EACCES: PortProblem.FORBIDDEN,
    errno.EPERM: PortProblem.FORBIDDEN,
    errno.ENOTTY: PortProblem.NOT_SERIAL,
    errno.EISDIR: PortProblem.NOT_SERIAL,
}


def _refused(path: str, error: Exception) -> PortError:
    number = _number(error)
    problem = _PROBLEMS.get(number or 0, PortProblem.FAILED)
    said = os.strerror(number) if number is not None else str(error)
    if problem is PortProblem.MISSING:
        why = f"{said}; plug it in (or start `quadlab simulator`), `quadlab vehicle --find` looks"
    elif problem is PortProblem.BUSY:
        why = "busy: another program has it open; end that one, another `quadlab vehicle` for one"
    elif problem is PortProblem.FORBIDDEN:
        why = f"permission denied; {_permission(path)}"
    elif problem is PortProblem.NOT_SERIAL:
        why = NO_DEVICE
    else:
        why = f"{said}; is it plugged in and working?"
    return PortError(problem, path, why)


def _number(error: BaseException | None) -> int | None:
    """Return the errno; pyserial keeps that of a termios.error only in the exception's context."""
    while error is not None:
        number = getattr(error, "errno", None)
        if number is None and isinstance(error, termios.error) and error.args:
            number = error.args[0]
        if isinstance(number, int):
            return number
        error = error.__context__
    return None


def _permission(path: str) -> str:
    """Return advice on how to get the right to open the device."""
    group, opens = "dialout", True
    try:
        about = os.stat(path)
        opens = about.st_mode & READ_AND_WRITE == READ_AND_WRITE
        group = grp.getgrgid(about.st_gid).gr_name
    except (OSError, KeyError):
        pass
    if opens and group != "root":
        return f"join its group: `sudo usermod -aG {group} $USER`, sign in again"
    return f"until it is plugged in again: `sudo chmod a+rw {path}`"
