"""The arm as rigid bodies: kinematics, dynamics and drives."""
