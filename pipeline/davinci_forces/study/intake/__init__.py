"""How the channels of a log become quantities of joints: clocks, units, gears, and what is odd about them."""
