"""Excel's workbooks (.xlsx): the columns of each sheet, below a row of names."""

from pathlib import Path

from davinci_forces.logs import isolated
from davinci_forces.logs.log import Log, Options

ZIP = b"PK\x03\x04"
SUFFIXES = (".xlsx", ".xlsm")
MEMBERS = (b"[Content_Types].xml", b"_rels/.rels", b"docProps/", b"xl/")  # one of them comes first


def recognises(path: Path, head: bytes) -> bool:
    """Whether it is a zip file of a workbook."""
    return head.startswith(ZIP) and (path.suffix.lower() in SUFFIXES or head[30:].startswith(MEMBERS))


def read(path: Path, options: Options) -> Log:
    """Open the workbook and list the columns of its sheets.

    Raises
    ------
    BadLog
        If openpyxl is not installed, or the workbook cannot be read.
    """
    isolated.require(path, "openpyxl", "xlsx")
    return isolated.start(path, options, "davinci_forces.logs.xlsx.sheets")
