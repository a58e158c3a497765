"""The disk to which files are fetched from the vehicle."""

from __future__ import annotations

from pathlib import Path

from console.catalogue.catalogue import Catalogue
from console.parameters.station import RecorderParameters
from console.runs.disk import check_folder, folder_problem, free_bytes, recreate_folder
from console.transfers.job import NotYetError
from console.transfers.part_file import NoRoomError
from quadrotor.errors import StorageError


class TransferDisk:
    """The folder of downloads, and the free space for them.

    Args:
        parameters: read at each check.
    """

    def __init__(self, folder: Path, catalogue: Catalogue, parameters: RecorderParameters) -> None:
        self._folder, self._catalogue, self._parameters = folder, catalogue, parameters

    def make_folder(self) -> None:
        """Create the folder if the data folder exists, as the recorder does. Otherwise its disk may
        not be mounted, and the folder would be created below the mount point. Raises StorageError.
        """
        if problem := self._catalogue.problem:
            raise StorageError(problem)
        recreate_folder(self._folder.parent)
        check_folder(self._folder, 0)

    def check_room(self, count: int) -> None:
        """Raise NoRoomError when this many more bytes leave less than the recorder keeps free, and
        NotYetError when the folder has disappeared.
        """
        keep = round(self._parameters.keep_free * 1e6)
        found, advice = folder_problem(self._folder)
        if found:
            raise NotYetError(f"{found}; {advice}; it continues when the folder is back")
        free = free_bytes(self._folder)
        if free - count < keep:
            raise NoRoomError(
                f"only {free // 10**6} MB are free in {self._folder}, {keep // 10**6} MB are kept "
                f"and {max(1, count // 10**6)} MB are needed; delete or move runs"
            )
