"""What others do with the same files: sparse regression of the force that the model lacks on a library of terms.

PySINDy's STLSQ (Brunton et al. 2016; de Silva et al. 2020) with its threshold chosen by AICc on the test run
(Mangan et al. 2017), and stepwise regression by AIC and by BIC. All get the same data: accelerations from the measured
velocities by Savitzky-Golay, which smooths forces and terms alike; the model's own coefficients projected off, as a
refit would; one column for each form of each force that the generator can conceal, in the generator's own formula,
which is more than a stranger would have. An effect in an actuator or a sensor, and a force with a memory, has no column
and cannot be named. Velocities that are not measured are taken for zero, surge for the cruise.

PySINDy is optional (`pip install pysindy`): without it `pysindy` is left out.
"""

import warnings
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from scipy.signal import savgol_filter

from jaxsub.effects import VELOCITIES
from jaxsub.recording import Recording, load
from jaxsub.vehicle import AbstractVehicle, read_vehicle

from .truth import Moment, Truth
from .truths import KNOWN

_WINDOW, _ORDER, _STRIDE = 11, 3, 5


def peers(folder: Path, body: str) -> dict[str, dict]:
    """The answers of the peers to the files in `folder`, in the form of the judge's."""
    vehicle = read_vehicle(folder / "vehicle.toml")
    recordings = [load(path) for path in sorted(folder.glob("run*.csv"))]
    library = [
        truth for truth in KNOWN if truth.is_column and truth.vehicle in (body, "nps" if "nps" in body else body)
    ]
    blocks = [_regression(vehicle, recording, library) for recording in recordings]
    train = [np.concatenate(parts) for parts in zip(*blocks[:-1], strict=True)]
    y, own, terms, equation = train
    scale = _scales(y, own, equation)
    weigh = lambda block: [a / scale[block[3]].reshape(-1, *[1] * (a.ndim - 1)) for a in block[:3]]
    (y, own, terms), (y_held, own_held, terms_held) = weigh(train), weigh(blocks[-1])
    y, terms = _without(own, y), _without(own, terms)
    y_held, terms_held = _without(own_held, y_held), _without(own_held, terms_held)
    size = np.linalg.norm(terms, axis=0)
    usable = size > 1e-9 * np.sqrt(len(y))
    terms, terms_held = terms[:, usable] / size[usable], terms_held[:, usable] / size[usable]
    library = [truth for truth, use in zip(library, usable, strict=True) if use]
    chosen = {"stepwise_aic": _stepwise(y, terms, 2.0), "stepwise_bic": _stepwise(y, terms, float(np.log(len(y))))}
    if (sparse := _sindy(y, terms, y_held, terms_held)) is not None:
        chosen["pysindy"] = sparse
    names = vehicle.layout.equations
    return {peer: _answer(picked, y, terms, train[3], library, names) for peer, picked in chosen.items()}


def _regression(vehicle: AbstractVehicle, recording: Recording, library: list[Truth]) -> tuple[np.ndarray, ...]:
    """Missing force, columns of the model's coefficients and of the library, and the equation of each row."""
    layout = vehicle.layout
    columns = recording.columns
    n, count = len(layout.equations), len(recording.times)
    rest = {"surge": vehicle.speed}
    rate = lambda e: columns.get(VELOCITIES.get(e, ""), columns.get(f"{e}_rate", np.full(count, rest.get(e, 0.0))))
    nu = np.stack([rate(e) for e in layout.equations], axis=1)
    eta = np.stack([columns.get(p, np.zeros(count)) for p in layout.positions], axis=1)
    # at a sample a held command is half the one before and half the one that begins: else it would come early
    held = [0.5 * (columns[c] + np.concatenate([columns[c][:1], columns[c][:-1]])) for c in layout.held]
    signals = np.stack([*held, *(columns[c] for c in layout.interpolated), recording.times], axis=1)
    step = float(np.median(np.diff(recording.times)))
    # velocities are smoothed first and differentiated then, so that forces and accelerations meet the same filter
    smooth = lambda a: savgol_filter(a, _WINDOW, _ORDER, axis=0)
    slope = lambda a: savgol_filter(a, 5, 4, deriv=1, delta=step, axis=0)
    state, signals = jnp.asarray(np.concatenate([nu, eta], axis=1)), jnp.asarray(signals)
    force = lambda v: np.asarray(v.force(v.motion(state, signals)) + state[:, :n] @ v.damping_matrix().T)
    base, values = force(vehicle), vehicle.values()
    own = np.stack([force(vehicle.with_values({p.name: values[p.name] + 1.0})) - base for p in layout.free], axis=-1)
    terms = np.stack([_column(vehicle, truth, state, signals, recording.times) for truth in library], axis=-1)
    missing = slope(smooth(nu)) @ np.asarray(vehicle.mass_matrix()).T - smooth(base)
    thin = slice(_WINDOW, -_WINDOW, _STRIDE)
    flat = lambda a: a[thin].reshape(-1, *a.shape[2:])
    rows = np.broadcast_to(np.arange(n), (count, n))
    return flat(missing), flat(smooth(own)), flat(smooth(terms)), flat(rows)


def _column(vehicle: AbstractVehicle, truth: Truth, state, signals, times: np.ndarray) -> np.ndarray:
    """The force of a unit of `truth` along the measured motion, (K, n)."""
    damping, equations = vehicle.damping_matrix(), vehicle.layout.equations

    def at(t, x, s):
        assert truth.force is not None
        felt = truth.force(jnp.ones(()), Moment(t, vehicle.motion(x, s), jnp.zeros(0), damping))
        return jnp.stack([jnp.asarray(felt.get(e, 0.0)) for e in equations])

    return np.asarray(jax.vmap(at)(jnp.asarray(times), state, signals))


def _scales(y: np.ndarray, own: np.ndarray, equation: np.ndarray) -> np.ndarray:
    """The rms of what the coefficients leave in each equation, found twice so that large equations do not rule."""
    scale = np.array([np.std(y[equation == i]) for i in range(equation.max() + 1)])
    for _ in range(2):
        left = _without(own / scale[equation][:, None], y / scale[equation])
        scale = scale * np.array([np.std(left[equation == i]) for i in range(len(scale))])
    return scale


def _without(own: np.ndarray, target: np.ndarray) -> np.ndarray:
    """`target` less what columns `own` explain of it."""
    size = np.linalg.norm(own, axis=0)
    q, r = np.linalg.qr(own[:, size > 0.0] / size[size > 0.0])
    q = q[:, np.abs(np.diag(r)) > 1e-9]
    return target - q @ (q.T @ target)


def _squares(y: np.ndarray, terms: np.ndarray, picked: list[int]) -> float:
    if not picked:
        return float(y @ y)
    found = np.linalg.lstsq(terms[:, picked], y, rcond=None)[0]
    return float(np.sum((y - terms[:, picked] @ found) ** 2))


def _stepwise(y: np.ndarray, terms: np.ndarray, price: float) -> list[int]:
    """Forward selection with backward elimination, each term for `price` in n log(squares)."""
    picked: list[int] = []
    cost = lambda chosen: len(y) * np.log(_squares(y, terms, chosen)) + price * len(chosen)
    while True:
        moves = [[*picked, j] for j in range(terms.shape[1]) if j not in picked]
        moves += [[i for i in picked if i != j] for j in picked]
        best = min(moves, key=cost, default=picked)
        if not cost(best) < cost(picked) - 1e-9:
            return picked
        picked = best


def _sindy(y: np.ndarray, terms: np.ndarray, y_held: np.ndarray, terms_held: np.ndarray) -> list[int] | None:
    """The terms that STLSQ keeps at the threshold with the lowest AICc on the test run."""
    try:
        from pysindy.optimizers import STLSQ  # pyright: ignore[reportMissingImports]
    except ImportError:
        return None
    best: tuple[float, list[int]] = (float(len(y_held) * np.log(y_held @ y_held)), [])
    reach = float(np.max(np.abs(terms.T @ y), initial=1e-12))
    for threshold in reach * np.geomspace(0.01, 0.99, 16):
        with warnings.catch_warnings():
            # a threshold that leaves nothing is one of those tried
            warnings.simplefilter("ignore", UserWarning)
            kept = STLSQ(threshold=threshold, alpha=1e-6).fit(terms, y[:, None]).coef_[0]
        k = int(np.count_nonzero(kept))
        fitted = np.sum((y_held - terms_held @ kept) ** 2)
        cost = len(y_held) * np.log(fitted) + 2 * k + 2 * k * (k + 1) / max(len(y_held) - k - 1, 1)
        if k and cost < best[0]:
            best = (float(cost), np.flatnonzero(kept).tolist())
    return best[1]


def _answer(
    picked: list[int], y: np.ndarray, terms: np.ndarray, equation: np.ndarray, library: list[Truth], names
) -> dict:
    """The terms picked, as a diagnosis would put them."""
    found = np.linalg.lstsq(terms[:, picked], y, rcond=None)[0] if picked else np.zeros(0)
    order = np.argsort(-np.abs(found))
    explained = (terms[:, picked] @ found) ** 2 if picked else np.zeros(len(y))
    shares = np.bincount(equation, explained, len(names))
    kept = list(dict.fromkeys(library[picked[i]].name for i in order))
    entry = lambda name: {"effect": name, "probability": None, "rivals": [], "parameters": {}}
    return {
        "verdict": "named" if kept else "none",
        "physics": [entry(name) for name in kept],
        "where": [names[i] for i in np.argsort(-shares)] if picked else [],
    }
