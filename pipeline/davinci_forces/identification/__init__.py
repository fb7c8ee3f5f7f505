"""Which models describe the joints: candidates, their scores, and the choice among them."""
