"""Whether a recording follows a path that was fitted, on which the model's error repeats."""

import numpy as np

from davinci_forces.maths.signals.path import SAME_PATH as LIKE
from davinci_forces.maths.signals.path import likeness
from davinci_forces.maths.signals.smoothing import segments
from davinci_forces.records import FittedPaths, Motion
from davinci_forces.records.prediction import ANOTHER_PATH as ANOTHER_PATH
from davinci_forces.records.prediction import SAME_PATH as SAME_PATH


def follows(motion: Motion, paths: FittedPaths) -> bool:
    """Whether the longest segment of a recording is like one of the paths."""
    part = max(segments(motion.segment), key=lambda s: s.stop - s.start)
    each = [np.flatnonzero(paths.source == log) for log in dict.fromkeys(paths.source)]
    likenesses = [
        likeness(motion.t[part], motion.q_measured[part], paths.q[rows], float(paths.period[rows[0]])) for rows in each
    ]
    return max(likenesses) > LIKE
