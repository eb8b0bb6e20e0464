"""The noise of a small vehicle's usual suite of sensors."""

# by channel, SI: Doppler log 1 cm/s, MEMS gyros 0.2 °/s, attitude 0.3°, pressure depth 5 cm
SIGMAS: dict[str, float] = {
    **dict.fromkeys("uvw", 0.01), **dict.fromkeys("pqr", 0.0035), "phi": 0.005, "theta": 0.005, "psi": 0.005, "z": 0.05
}  # fmt: skip
OUTPUTS: dict[str, dict[str, float]] = {channel: {"sigma": sigma} for channel, sigma in SIGMAS.items()}
