"""Models of the joints: candidates, their scores, and the choice among them."""
