"""Proposed effects fitted, and accepted or rejected by what they gain on blocks of the training runs."""
