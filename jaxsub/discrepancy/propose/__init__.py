"""Which effects, or which nonparametric force, explain the mismatch best by the linearised model."""
