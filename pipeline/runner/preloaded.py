"""What a worker has imported before it is handed a task; importing this is what it takes."""

from pipeline.runner import execution, workers

__all__ = ["execution"]

workers.import_stages()
