"""MCAP as columns: the only part of roadlog that knows MCAP bytes."""

from roadlog.storage.reader import LogReader
from roadlog.storage.records import MAGIC
from roadlog.storage.table import Channel, Table
from roadlog.storage.update import update_log
from roadlog.storage.writer import write_log

__all__ = ["MAGIC", "Channel", "LogReader", "Table", "update_log", "write_log"]
