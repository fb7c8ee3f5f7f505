"""What was recorded, and how it is to be analysed: study.toml as data, and the reading of it."""

from davinci_forces.haptics.scenario import HapticScenario
from davinci_forces.study.study import WHOLE, HungMass, LogEntry, Settings, Source, Study, Weighing, Weighings

__all__ = ["WHOLE", "HapticScenario", "HungMass", "LogEntry", "Settings", "Source", "Study", "Weighing", "Weighings"]
