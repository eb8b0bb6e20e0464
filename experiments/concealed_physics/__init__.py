"""Is what was concealed found again? A generator that knows the truth, and a judge that sees files alone."""
