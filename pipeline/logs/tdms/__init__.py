"""TDMS files, the binary logs of LabVIEW and DIAdem."""

from pipeline.logs.tdms.reader import read, recognises

__all__ = ["read", "recognises"]
