"""A fitted model linearised about its filtered trajectory, and the evidence of candidates there."""
