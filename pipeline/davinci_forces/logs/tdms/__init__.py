"""TDMS files, the binary logs of LabVIEW and DIAdem."""

from davinci_forces.logs.tdms.reader import read, recognises

__all__ = ["read", "recognises"]
