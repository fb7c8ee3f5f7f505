"""The simulated hand that feels tissue through the arm."""
