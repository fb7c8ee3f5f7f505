"""What people write down: tables of a TOML file, read key by key, and everything wrong with them said at once.

Study, robot and scenario are read with it; every problem has its file and its line.
"""

from davinci_forces.toml.ranges import unlikely
from davinci_forces.toml.table import TomlTable, is_number, parse, read, shown

__all__ = ["TomlTable", "is_number", "parse", "read", "shown", "unlikely"]
