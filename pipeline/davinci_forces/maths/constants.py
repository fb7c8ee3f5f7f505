"""Constants of nature, with the values of the thesis."""

GRAVITY = 9.81  # [m/s^2]; 9.82 does not reproduce the thesis's printed numbers
