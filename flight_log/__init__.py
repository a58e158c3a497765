"""Flight logs: one crash-safe MCAP file for each run, written and read by both ends of the link."""

from flight_log.index import is_closed
from flight_log.reader import LogMessage, read_attachments, read_log, read_metadata
from flight_log.recovery import Recovery, recover
from flight_log.summary import LogSummary, TopicSummary, summarize
from flight_log.writer import LogWriter

__all__ = [
    "LogMessage",
    "LogSummary",
    "LogWriter",
    "Recovery",
    "TopicSummary",
    "is_closed",
    "read_attachments",
    "read_log",
    "read_metadata",
    "recover",
    "summarize",
]
