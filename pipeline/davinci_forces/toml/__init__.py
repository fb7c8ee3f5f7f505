"""Read the TOML files that people write, key by key, and report all problems at once, each with file and line."""

from davinci_forces.toml.lines import TomlFile
from davinci_forces.toml.table import TomlTable, excerpt, in_toml, is_number, numbers_of_option, parse, read, unlikely

__all__ = ["TomlFile", "TomlTable", "excerpt", "in_toml", "is_number", "numbers_of_option", "parse", "read", "unlikely"]
