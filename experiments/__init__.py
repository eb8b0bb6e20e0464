"""Experiments: commands that produce the numbers and figures the README quotes."""
