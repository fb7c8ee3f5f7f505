"""LabVIEW measurement files (LVM), the text that LabVIEW writes with headers."""

from davinci_forces.logs.lvm.reader import read, recognises

__all__ = ["read", "recognises"]
