"""Controllers on the sampled plant: agreement of its exports, and predictive control before and after a diagnosis."""
