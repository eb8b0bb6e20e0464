"""A vehicle that does not run free: REMUS 100 under an autopilot, with all of its nonlinear terms missing at once."""
