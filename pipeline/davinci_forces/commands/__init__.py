"""Commands besides the stages: each module exports `run`, and its docstring is the help; `COMMANDS` lists them."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

COMMANDS = (
    "new", "inspect", "verify", "simulate", "robot", "excite", "stability", "haptics", "compare", "campaign", "export",
    "guide",
)  # fmt: skip

# Arguments and options of several commands.
StudyFolder = Annotated[Path, Argument(help="Folder of a study: raw/<study>, with its study.toml.")]
Studies = Annotated[list[Path] | None, Argument(help="Folders of studies; without any, all studies in raw/.")]
Processed = Annotated[Path | None, Option(help="Folder for processed files, instead of processed/ next to raw/.")]
Reports = Annotated[Path | None, Option(help="Folder for reports, instead of reports/ next to raw/.")]
AsJson = Annotated[bool, Option("--json", help="Print the result as JSON.")]
