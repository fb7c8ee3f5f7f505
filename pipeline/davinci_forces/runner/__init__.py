"""What runs again, and why: planning a study's tasks, running them, and remembering what each was made from."""

from davinci_forces.report import REPORT
from davinci_forces.stages import STAGES

ALL = (*STAGES, REPORT)  # everything that a run may do, in order
