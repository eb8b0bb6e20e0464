"""jaxsub: differentiable models of vehicles that move in water."""
