"""What was recorded, and how it is to be analysed: study.toml as data, and the reading of it."""

from pipeline.study.haptics import HapticScenario
from pipeline.study.study import WHOLE, HungMass, LogEntry, Settings, Source, Study, Weighing, Weighings

__all__ = ["WHOLE", "HapticScenario", "HungMass", "LogEntry", "Settings", "Source", "Study", "Weighing", "Weighings"]
