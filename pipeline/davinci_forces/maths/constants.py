"""Constants of nature, as the thesis takes them."""

GRAVITY = 9.81  # [m/s^2]; 9.82 does not reproduce the thesis's printed numbers
