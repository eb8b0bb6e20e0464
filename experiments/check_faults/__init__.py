"""How often checks find a fault that was put into a run, by its size, and how often they find one in a clean run."""
