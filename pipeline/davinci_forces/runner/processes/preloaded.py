"""Import all that a worker needs before its first task."""

from davinci_forces.logs.isolated import process

process.end_with_parent()  # first, because importing takes seconds

from davinci_forces.runner import execution  # noqa: E402
from davinci_forces.runner.processes import workers  # noqa: E402

__all__ = ["execution"]

workers.import_stages()
