"""Flight logs: one crash-safe MCAP file a run, written and read by both ends of the link."""

from vehicle_link.log.reader import LogMessage, read_attachments, read_log, read_metadata
from vehicle_link.log.recovery import Recovery, is_closed, recover
from vehicle_link.log.summary import LogSummary, TopicSummary, summarize
from vehicle_link.log.writer import LogWriter

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
