"""Excel's workbooks (.xlsx): the columns of each sheet, below a row of names."""

from pathlib import Path

from davinci_forces.logs import isolated
from davinci_forces.logs.log import Log, Options

FIRST_MEMBERS = (b"[Content_Types].xml", b"_rels/.rels", b"docProps/", b"xl/")


def recognises(path: Path, head: bytes) -> bool:
    """Whether it is a zip file of a workbook."""
    is_named = path.suffix.lower() in (".xlsx", ".xlsm")
    return head.startswith(b"PK") and (is_named or head[30:].startswith(FIRST_MEMBERS))


def read(path: Path, options: Options) -> Log:
    """Open the workbook and list the columns of its sheets.

    Raises
    ------
    BadLog
        If openpyxl is not installed, or the workbook cannot be read.
    """
    isolated.require(path, "openpyxl", "xlsx")
    return isolated.start(path, options, "davinci_forces.logs.xlsx.sheets")
