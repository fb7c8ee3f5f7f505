"""What was recorded, and how it is to be analysed: study.toml as data, and the reading of it."""

from pipeline.study.study import HungMass, LogEntry, Settings, Source, Study, Weighing, Weighings

__all__ = ["HungMass", "LogEntry", "Settings", "Source", "Study", "Weighing", "Weighings"]
