"""`quadlab log recover LOG`."""

from __future__ import annotations

from dataclasses import dataclass

from quadlab.log_commands.log_file import LogFile, check_log_file


@dataclass
class Recover:
    """Mend the log of a writer that was killed, in place; a whole one is left alone."""

    file: LogFile
    """the MCAP file"""

    def run(self) -> int:
        from vehicle_link.log.recovery import recover

        check_log_file(self.file)
        found = recover(self.file)
        if not found.torn:
            print(f"{self.file} is whole; nothing was changed")
        else:
            print(
                f"{self.file} was torn ({found.reason}) and is mended in place: "
                f"{found.messages} messages kept, {found.lost_bytes} bytes behind the tear "
                f"and {found.damaged_chunks} damaged chunks lost"
            )
            if found.kept is not None:
                print(f"as it was, it is kept as {found.kept}: there is more behind the tear")
        return 0
