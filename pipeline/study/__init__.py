"""What was recorded, and how it is to be analysed: study.toml as data, and the reading of it."""

from pipeline.study.study import WHOLE, LogEntry, Settings, Source, Study, Weight

__all__ = ["WHOLE", "LogEntry", "Settings", "Source", "Study", "Weight"]
