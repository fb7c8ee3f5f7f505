"""Constants that several rooms share, with the values of the thesis."""

GRAVITY = 9.81  # [m/s^2]; 9.82 does not reproduce the thesis's printed numbers
PUSH_DELAY = 0.1  # [s] by which a filter may show a push late, unless the settings of a study state another
