"""Why innovations are not white: each cause is taken away by itself, and the filter run again without it."""
