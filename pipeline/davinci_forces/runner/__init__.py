"""Plan the tasks of a study, run those that are not up to date, and record what each result was made from."""

from davinci_forces.report import REPORT
from davinci_forces.stages import STAGES

ALL = (*STAGES, REPORT)  # in the order of a run
