"""What a worker has imported before it is handed a task; importing this is what it takes."""

from pipeline.logs.isolated import orphans

orphans.end_with_parent()  # before the seconds of importing

from pipeline.runner import execution  # noqa: E402
from pipeline.runner.processes import workers  # noqa: E402

__all__ = ["execution"]

workers.import_stages()
