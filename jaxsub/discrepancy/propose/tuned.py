r"""Frequencies of waves, tuned to the largest evidence of a wave.

A force shows a frequency to about a spectral line, and a wave many sigma large that is off by so little is out of step
at both ends of a run. About the middle m of the runs it is close to $a\cos\omega t + b\sin\omega t +
\delta\,(t-m)(b\cos\omega t - a\sin\omega t)$, so four columns beside the free parameters have the step
$\delta = (bq - ap)/(a^2+b^2)$ of Gauss and Newton, p and q the amplitudes of $(t-m)\sin\omega t$ and
$(t-m)\cos\omega t$ (Golub and Pereyra 1973, SIAM J. Numer. Anal. 10).
"""

import dataclasses

import numpy as np
from scipy import special

from ...effects import Facts
from .. import settings
from ..linearise.columns import columns_of
from ..linearise.evidence import Evidence
from ..linearise.products import Products
from ..linearise.view import View

# of independent frequencies, of which a step is no more than one: the smallest step that is worth another
_NEAR = 0.02
_STEPS = 4


def tuned(view: View, known: Facts) -> Facts:
    """The facts, with `tones` each at a frequency where a wave is more probable, if there is one nearby."""
    listed = [(equation, tone) for equation, tones in known.tones.items() for tone in tones]
    if not listed:
        return known
    equations, now = [equation for equation, _ in listed], np.array([tone for _, tone in listed])
    line = 2.0 * np.pi / known.duration
    best, most = now, np.full(len(now), -np.inf)
    for _ in range(1 + _STEPS):
        value, step = _looked(view, known, equations, now)
        best, most = np.where(value > most, now, best), np.maximum(value, most)
        step = np.where(value < most, 0.0, np.clip(step, -line, line))
        if np.all(np.abs(step) < _NEAR * line):
            break
        now = best + step
    own = {e: tuple(float(w) for w, at in zip(best, equations, strict=True) if at == e) for e in known.tones}
    return dataclasses.replace(known, tones=own)


def _looked(view: View, known: Facts, equations: list[str], omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Log evidence of a wave in each of n equations at each of n frequencies, and the step to where there is more."""
    free = view.vehicle.layout.equations
    times = np.stack([view.path.start.time, view.path.end.time])
    forces = []
    for equation, tone in zip(equations, omega, strict=True):
        own = np.array([float(e == equation) for e in free])
        cos, sin = np.cos(tone * times), np.sin(tone * times)
        late = times - 0.5 * known.duration
        forces += [signal[..., None] * own for signal in (cos, sin, late * sin, late * cos)]
    evidence = Evidence.of(view, columns_of(view, forces))
    looks = [_of(products, evidence.length, len(omega), known.frequencies) for products in evidence.products]
    value, step = (np.stack(parts) for parts in zip(*looks, strict=True))
    first = np.argmax(value, axis=0), np.arange(len(omega))
    return value[first], step[first]


def _of(products: Products, length: np.ndarray, count: int, tried: int) -> tuple[np.ndarray, np.ndarray]:
    """The same under one disturbance; a wave that is not significant among all frequencies `tried` stays."""
    wave = products.gains([], [[4 * i, 4 * i + 1] for i in range(count)])
    near = products.gains([], [range(4 * i, 4 * i + 4) for i in range(count)])
    a, b, p, q = (np.stack(near.amplitudes) / length.reshape(count, 4)).T
    significant = tried * special.chdtrc(2, wave.statistic) < settings.SIGNIFICANCE
    step = np.where(significant, (b * q - a * p) / np.maximum(a * a + b * b, 1e-300), 0.0)
    return products.log_evidence([]) + wave.evidence, step
