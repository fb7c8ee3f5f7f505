"""The arm as rigid bodies: kinematics, dynamics, and what the drives add."""
