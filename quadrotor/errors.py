"""The errors that a user can cause, and the rule for their messages.

Every message says what was received, what is allowed and what to try, in one line: it is shown
unchanged on the page and in the terminal.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum


class QuadlabError(Exception):
    """Root of every error caused by the user, the network or the disk, not by a defect."""


class ParameterError(QuadlabError):
    """A parameter name or value was refused; nothing was changed."""


class UnknownParameterError(ParameterError):
    """Raised when no parameter has this name."""


class OutOfBoundsError(ParameterError):
    """The value is not finite or outside the parameter's bounds."""


class WrongTypeError(ParameterError):
    """The value's type does not fit the parameter."""


class ReadOnlyError(ParameterError):
    """The parameter cannot be changed now."""


class Refusal(StrEnum):
    """Kinds of a refusal, for programs that act on it; most refusals have none."""

    NONE = ""
    NOT_AT_REST = "not_at_rest"
    """The vehicle moves still: it may be asked again soon."""
    NO_REFERENCE = "no_reference"
    """No reference from outside is there to be followed, or only an old one."""


class RefusedError(QuadlabError):
    """A command (arm, behavior, emergency, ...) was refused; the text is the reason."""

    def __init__(self, reason: str = "", kind: str = Refusal.NONE) -> None:
        super().__init__(reason)
        self.kind = kind


class MeasurementError(QuadlabError):
    """A measurement cannot be used: not finite, not unit length, of the wrong shape, no fit."""


class DegenerateGeometryError(MeasurementError):
    """The measurement, or the positions of the beacons, do not determine a pose."""


class UndeterminedStartError(DegenerateGeometryError):
    """The measurement could correct a known pose, but does not determine one by itself."""


class LinkError(QuadlabError):
    """The radio link, a service or a session failed or did not answer in time."""


class ClockNotSetError(LinkError):
    """Raised when the computer's clock is before the certificates of the link begin: once it is
    set, the same call may succeed.
    """


class NoAnswerError(LinkError):
    """Raised when no answer arrived in time: the request may or may not have been executed.

    It is worth repeating under the same request id.
    """


class UnreachableError(NoAnswerError):
    """Raised when the other side cannot be reached: nothing was executed."""


class StorageError(QuadlabError):
    """A file or folder cannot be read or written, or the disk is full."""


class LogFormatError(QuadlabError):
    """The log is torn, or the file is not a log of the expected kind."""


class JobError(QuadlabError):
    """A helper process could not be started, crashed or was killed."""


class JobTimeoutError(JobError):
    """A helper process was not done in time and was ended."""


class UsageError(QuadlabError):
    """Wrong usage of the command line; the process exits with status 2."""


@contextmanager
def os_errors(
    line: Callable[[str], str], kind: type[QuadlabError] = StorageError
) -> Iterator[None]:
    """Raise an OSError of the block as an error of this kind, whose message is the line that tells
    the operating system's reason.
    """
    try:
        yield
    except OSError as error:
        raise kind(line(error.strerror or str(error))) from error
