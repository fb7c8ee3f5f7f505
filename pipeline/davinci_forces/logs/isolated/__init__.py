"""Logs that are read by libraries in C, in a process of their own with limits of time and memory.

A damaged file can take such a library down, keep it busy for ever, or have it ask for more memory than there is.  It
then costs a child process, and is a `BadLog` like any other.
"""

from davinci_forces.logs.isolated.log import require, start

__all__ = ["require", "start"]
