"""A glider's mission of hundreds of dives: how the time and memory of its diagnosis grow, and what is named."""
