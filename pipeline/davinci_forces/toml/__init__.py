"""Read the TOML files that people write, key by key, and report all problems at once, each with file and line.

Study, robot and scenario are read with it, and `in_toml` writes their values.
"""

from davinci_forces.toml.lines import TomlFile
from davinci_forces.toml.table import TomlTable, excerpt, in_toml, is_number, numbers_of_option, parse, read, unlikely

__all__ = ["TomlFile", "TomlTable", "excerpt", "in_toml", "is_number", "numbers_of_option", "parse", "read", "unlikely"]
