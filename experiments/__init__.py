"""Experiments: commands that produce the numbers and figures of README and of the pages here."""
