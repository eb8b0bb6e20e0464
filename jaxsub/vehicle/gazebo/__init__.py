"""Vehicles from and to Gazebo: models in SDF with the hydrodynamics, thruster and buoyancy systems of Gazebo Harmonic.

Gazebo's body axes are x ahead, y to port, z up, and ours x ahead, y to starboard, z down: a half turn about x, by which
velocities, forces and coefficients change their signs (`terms.SIGNS`).
"""

from .read import read_sdf
from .write import sdf_text

__all__ = ["read_sdf", "sdf_text"]
