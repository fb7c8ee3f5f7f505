"""What was recorded, and how it is to be analysed: study.toml as data, and the reading of it."""

from pipeline.study.study import LogEntry, Settings, Source, Study, Weighing, Weighings, Weight

__all__ = ["LogEntry", "Settings", "Source", "Study", "Weighing", "Weighings", "Weight"]
