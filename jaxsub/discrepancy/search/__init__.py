"""Rounds of proposals and acceptances, in simulation and by innovations, until nothing more is accepted."""
