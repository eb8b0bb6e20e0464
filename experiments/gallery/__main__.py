"""`python -m experiments.gallery --out DIR [--quick]`: a picture of every effect that a diagnosis may name.

One manoeuvre of a catalogue vehicle (or a rig) is simulated with the effect and without it; DIR/NAME.png shows the
channel that shows it, and DIR/results.json what was put in. What is there already is kept, so that an interrupted run
goes on where it stopped. `--quick` draws one effect of each family.
"""

import argparse
import json
from collections.abc import Iterator, Mapping
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from jaxsub.cli import session, terminal
from jaxsub.effects import VOCABULARY, AbstractEffect, amplitudes, candidates, numbers, with_numbers
from jaxsub.estimate import batch
from jaxsub.recording import Recording
from jaxsub.simulation import simulate
from jaxsub.vehicle import AbstractVehicle

from .picture import draw
from .scenes import SCENES, SHARE, Scene, facts, stage

_HALVINGS = 40


class Stage:
    """A body with its manoeuvre, and what its sensors show without any effect: (K, c)."""

    def __init__(self, name: str):
        self.vehicle, drive, start = stage(name)
        channels = dict.fromkeys(self.vehicle.layout.channels, np.full(len(drive.times), np.nan))
        self.drive = Recording(name, drive.times, drive.columns | channels, name)
        self.runs, self.start = batch(self.vehicle, [self.drive]), jnp.asarray(start)[None]
        self.plain = self.shown(self.vehicle)
        by_channel = dict(zip(self.vehicle.layout.channels, self.plain.T, strict=True))
        self.candidates = candidates(facts(self.vehicle, drive, by_channel))

    def shown(self, vehicle: AbstractVehicle) -> np.ndarray:
        """What the sensors of `vehicle` show, without noise."""
        runs = self.runs if not vehicle.effects else batch(vehicle, [self.drive])
        # what an effect remembers comes last and starts at zero
        count = len(vehicle.layout.equations) + len(vehicle.layout.positions)
        start = jnp.pad(self.start, [(0, 0), (0, count - self.start.shape[1])])
        return np.asarray(simulate(vehicle, runs, start))[0]


def effect_of(scene: Scene, on: Stage) -> AbstractEffect:
    """The form that the scene needs, of the size that it states or that moves its channel by `SHARE`."""
    form = next(e for e in on.candidates if e.name == scene.name and (not scene.label or f"[{scene.label}" in e.label))
    stated = with_numbers(form, numbers(form) | dict(scene.numbers))
    free = [name for name in amplitudes(form) if name not in scene.numbers]
    if not free:
        return stated
    channel = on.vehicle.layout.channels.index(scene.channel)
    aim = SHARE * np.ptp(on.plain[:, channel])

    def sized(size: float) -> AbstractEffect:
        return with_numbers(stated, numbers(stated) | {n: size * (stated.signs()[n] or 1) for n in free})

    low, high = 1e-15, 1e9
    for _ in range(_HALVINGS):
        middle = np.sqrt(low * high)
        change = on.shown(on.vehicle.with_effect(sized(middle)))[:, channel] - on.plain[:, channel]
        moved = np.max(np.abs(change))
        low, high = (middle, high) if moved < aim else (low, middle)
    return sized(float(f"{low:.2g}"))


def pictures(out: Path, quick: bool, known: Mapping[str, dict]) -> Iterator[dict]:
    """Draw each scene that is not `known`, and say of all what they show."""
    stages: dict[str, Stage] = {}
    families = {kind.name: kind.family for kind in VOCABULARY}
    seen = set()
    for scene in SCENES:
        family = families[scene.name]
        if quick and family in seen:
            continue
        seen.add(family)
        if scene.name in known and (out / f"{scene.name}.png").is_file():
            yield known[scene.name]
            continue
        on = stages[scene.body] = stages.get(scene.body) or Stage(scene.body)
        effect = effect_of(scene, on)
        channel = on.vehicle.layout.channels.index(scene.channel)
        changed = on.shown(on.vehicle.with_effect(effect))[:, channel]
        if not np.all(np.isfinite(changed)) or np.allclose(changed, on.plain[:, channel]):
            raise RuntimeError(f"{effect.label} diverges, or does not show in {scene.channel}")
        draw(out / f"{scene.name}.png", scene.channel, on.drive, on.vehicle, on.plain[:, channel], changed)
        terminal.note(f"{effect.label} in {scene.channel}")
        yield {
            "name": scene.name,
            "family": family,
            "form": effect.label,
            "vehicle": on.vehicle.layout.name,
            "where": list(effect.where),
            "expression": effect.expression,
            "numbers": {effect.symbols()[n]: [value, effect.units()[n]] for n, value in numbers(effect).items()},
            "channel": scene.channel,
            "largest_change": float(np.max(np.abs(changed - on.plain[:, channel]))),
            "range": float(np.ptp(on.plain[:, channel])),
        }


def main() -> None:
    """Arguments in, figures out."""
    parser = argparse.ArgumentParser(prog="python -m experiments.gallery", description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--quick", action="store_true", help="one effect of each family")
    chosen = parser.parse_args()
    session.start()
    chosen.out.mkdir(parents=True, exist_ok=True)
    results = chosen.out / "results.json"
    before = json.loads(results.read_text(encoding="utf-8"))["effects"] if results.is_file() else []
    found = []
    for row in pictures(chosen.out, chosen.quick, {row["name"]: row for row in before}):
        found.append(row)
        later = [other for other in before if other["name"] not in [one["name"] for one in found]]
        text = json.dumps({"effects": found + later}, indent=1, ensure_ascii=False)
        results.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
