"""The arm in closed loop: controllers, drives, friction and surroundings."""
