"""What runs again, and why: planning a study's tasks, running them, and remembering what each was made from."""

from pipeline.report import REPORT
from pipeline.stages import STAGES

STEPS = (*STAGES, REPORT)  # everything that a run does, in order
