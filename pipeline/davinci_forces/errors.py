"""Exceptions that the pipeline raises on purpose.  The command line prints them without a traceback."""

import shlex
import sys


def install(package: str) -> str:
    """The command that installs an optional package into the environment that runs."""
    return f"{shlex.quote(sys.executable)} -m pip install {package}"


class PipelineError(Exception):
    """The data, the study or the request is wrong; the message says where, and what to do."""


class BadStudy(PipelineError):
    """A study file is wrong; the message lists all problems with their lines."""


class BadRobot(PipelineError):
    """A robot file is wrong, or a robot, joint or term does not exist."""


class BadLog(PipelineError):
    """A log cannot be read, or its content is not plausible; the message names the file and the place in it."""


class BadRecord(PipelineError):
    """A record has wrong shapes or lengths, or values that are not finite."""


class NotPeriodic(PipelineError):
    """A recording does not repeat, or holds fewer than two periods."""


class NotIdentifiable(PipelineError):
    """The data do not determine the parameters of a model."""


class MissingRecord(PipelineError):
    """A record or a result that is needed has not been made yet."""


class NotReproduced(PipelineError):
    """A file or a number does not agree with its provenance."""


class BadRequest(PipelineError):
    """A request on the command line cannot be carried out."""


class NotAFile(PipelineError, OSError):
    """A path to be read is a pipe, a device, a socket, a folder or an endless file."""

    def __str__(self) -> str:
        return f"{self.filename}: {self.strerror}"
