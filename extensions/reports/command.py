"""`quadlab log report LOG`."""

from __future__ import annotations

from dataclasses import dataclass

from quadlab.log_commands.log_file import LogFile, check_log_file
from quadlab.option_types import Flag, Folder


@dataclass
class Report:
    """Write figures, metrics, parameters and calibrations of a log as a page and a PDF."""

    file: LogFile
    """the MCAP file"""
    out: Folder = None
    """folder for it (default: next to the log)"""
    no_pdf: Flag = False
    """only the page"""

    def run(self) -> int:
        check_log_file(self.file)
        from extensions.reports.report import write_report
        from quadlab.simulated.sensors import new_defaults

        here = self.file.resolve()
        folder = self.out or (here if here.is_dir() else here.parent)
        for path in write_report(self.file, folder, pdf=not self.no_pdf, defaults=new_defaults):
            print(path)
        return 0
