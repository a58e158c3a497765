"""`quadlab log recover LOG`."""

from __future__ import annotations

from dataclasses import dataclass

from quadlab.log_commands.log_file import LogFile, check_log_file
from quadrotor.errors import LogFormatError


@dataclass
class Recover:
    """Repair, in place, the log of a writer that was killed; a complete one is left alone. Damage
    that cannot be repaired is reported, with exit status 1."""

    file: LogFile
    """the MCAP file"""

    def run(self) -> int:
        from flight_log.recovery import recover

        check_log_file(self.file)
        found = recover(self.file)
        if not found.torn:
            return self._left_alone()
        print(
            f"{self.file} was torn ({found.reason}) and was repaired in place: "
            f"{found.messages} messages kept, {found.lost_bytes} bytes behind the tear "
            f"and {found.damaged_chunks} damaged chunks lost"
        )
        if found.kept is not None:
            print(f"as it was, it is kept as {found.kept}: there is more behind the tear")
        return 0

    def _left_alone(self) -> int:
        from flight_log.check import damage

        try:
            lines = damage(self.file)
        except LogFormatError:  # its compression is not supported; its index is sound
            lines = []
        for line in lines:
            print(f"damaged, and cannot be brought back: {line}")
        if lines:
            print(
                f"{self.file} has its index, and nothing was changed; the rest of it can be read, "
                "checked and exported as it is"
            )
            return 1
        print(f"{self.file} is complete; nothing was changed")
        return 0
