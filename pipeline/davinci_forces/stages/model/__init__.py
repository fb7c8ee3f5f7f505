"""What every joint needs to move: parameters, the model that the arm is taken to have, and how well it predicts."""
