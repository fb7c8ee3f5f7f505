"""From logs to the motion of every joint: read, put on one clock, averaged over its periods and differentiated."""
