"""Reading a TOML file, so that what is wrong with it can be said with its lines."""

import tomllib
from pathlib import Path

from davinci_forces.errors import PipelineError
from davinci_forces.toml.file import TomlFile
from davinci_forces.toml.lines import lines_of
from davinci_forces.toml.table import TomlTable

LARGEST = 4_000_000  # bytes: ten thousand logs with all their channels; what is larger was written by mistake


def read(file: Path, kind: type[PipelineError], missing: str = "there is no such file") -> TomlTable:
    """The whole of a file.  What it says is checked by who asks the table for it.

    Raises
    ------
    PipelineError
        Of that kind, if the file cannot be read or is not TOML.
    """
    try:
        if (size := file.stat().st_size) > LARGEST:
            raise kind(
                f"{file}: it has {size / 1e6:.1f} MB, and what people write down has at most {LARGEST / 1e6:.0f}: is "
                "it a log? Of a study this large, make several"
            )
        text = file.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise kind(f"{file}: {missing}") from None
    except OSError as error:
        raise kind(f"{file}: {error.strerror}") from None
    except ValueError as error:  # of UTF-8
        raise kind(f"{file}: {error}") from None
    return parse(text, str(file), kind)


def parse(text: str, name: str, kind: type[PipelineError]) -> TomlTable:
    """The whole of a text of TOML, called `name` in problems; raises as `read` does."""
    try:
        values, lines = tomllib.loads(text), lines_of(text)
    except (ValueError, RecursionError) as error:  # of TOML, and of numbers and nesting beyond Python's limits
        raise kind(f"{name}: {error}") from None
    return TomlTable(values, TomlFile(name, lines))
