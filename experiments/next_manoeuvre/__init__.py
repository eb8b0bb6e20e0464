"""The manoeuvre that tells rivals apart: designed, driven in simulation, and the rivals fitted again."""
