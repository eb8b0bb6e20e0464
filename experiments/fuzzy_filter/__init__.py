"""The second paper re-examined: its filter, its claims, and the same filter on real recordings."""
