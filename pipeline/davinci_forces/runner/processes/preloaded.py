"""Import all that a worker needs before its first task."""

from davinci_forces.logs.isolated import process

process.end_with_parent()  # first, because importing takes seconds

from importlib import import_module  # noqa: E402

from davinci_forces.runner import execution as execution  # noqa: E402
from davinci_forces.runner.processes import workers as workers  # noqa: E402
from davinci_forces.stages import STAGES, module  # noqa: E402

for name in STAGES:
    import_module(module(name))
