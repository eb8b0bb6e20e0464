"""Vehicles of the catalogue, each with one effect that its file leaves out."""
