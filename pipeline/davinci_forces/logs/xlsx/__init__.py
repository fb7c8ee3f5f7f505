"""Excel's workbooks (.xlsx): the columns of each sheet, below a row of names."""

from pathlib import Path

from davinci_forces.logs.isolated import reader

FIRST_MEMBERS = (b"[Content_Types].xml", b"_rels/.rels", b"docProps/", b"xl/")
read = reader("davinci_forces.logs.xlsx.sheets", "openpyxl", "xlsx")


def recognises(path: Path, head: bytes) -> bool:
    """Whether it is a zip file of a workbook."""
    is_named = path.suffix.lower() in (".xlsx", ".xlsm")
    return head.startswith(b"PK") and (is_named or head[30:].startswith(FIRST_MEMBERS))
