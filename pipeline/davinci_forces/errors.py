"""Everything the pipeline raises on purpose.  The command line prints these without a traceback."""


class PipelineError(Exception):
    """The data, the study or the request is wrong; the message says where and what to do."""


class BadStudy(PipelineError):
    """A study file breaks its contract; every problem is listed, each with its place in the file."""


class BadRobot(PipelineError):
    """A robot, joint or term does not exist, or a robot file is wrong."""


class BadLog(PipelineError):
    """A log cannot be read, or what it holds cannot be trusted; names the file and the place in it."""


class BadRecord(PipelineError):
    """A record breaks its own contract: shapes, lengths, finite values."""


class NotPeriodic(PipelineError):
    """A recording does not repeat, or holds fewer than two periods."""


class NotIdentifiable(PipelineError):
    """The data do not determine the parameters that are asked of them."""


class MissingRecord(PipelineError):
    """A record that a stage needs has not been made yet."""


class NotReproduced(PipelineError):
    """A file or a number is not what its provenance says it should be."""


class BadRequest(PipelineError):
    """What was asked on the command line cannot be done."""


class NotAFile(PipelineError, OSError):
    """A pipe, a device, a socket, a folder or an endless file stands where a file is read."""

    def __str__(self) -> str:
        return f"{self.filename}: {self.strerror}"
