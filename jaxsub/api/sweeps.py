"""Sweeps: Monte-Carlo over initial guesses, noise, vehicles and recordings, and what it shows."""

import dataclasses
import json
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

from ..errors import InputError
from ..estimate import require_free
from ..plain import to_json
from ..recording import Recording
from ..recording.recording import Recordings
from ..sweeps import Plan, Store, answered, check_folder, open_sweep, require_memory, summarised
from ..sweeps import sweep as run_plan
from ..vehicle import AbstractVehicle
from ..workers import require_cluster
from .recordings import checked
from .result import AbstractResult
from .table import Parts, Table

if TYPE_CHECKING:
    import pandas
    import xarray

    from ..report import Picture

_TOGETHER = "all"
RESULT, DATA, FIGURES = "sweep.json", "sweep.nc", "figures"
Vehicles = AbstractVehicle | Mapping[str, AbstractVehicle]


def sweep(
    vehicle: Vehicles,
    recordings: Recordings,
    *,
    starts: int,
    folder: str | Path | None = None,
    spread: float = 0.5,
    noise_seeds: int = 0,
    apart: bool = False,
    method: str = "gauss-newton",
    seed: int = 0,
    compiled: bool = False,
    cluster: str | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> "Sweep":
    """Fits from `starts` initial guesses: what `jaxsub sweep` computes.

    `vehicle` is one, or several by name; `recordings` are one or several, checked as `js.check` does, and fitted all
    together or, with `apart`, each on its own. Guesses are drawn by `seed` within ± `spread` of each coefficient's
    value, and searched by `method`, as of `js.fit`. With `noise_seeds` the recordings are answers of a fitted vehicle
    with noise drawn that often: a bootstrap. `compiled` searches by C made of the model. What is done is kept in
    `folder`, where the same call goes on; without one in a temporary folder. `cluster` is the address of a Dask
    scheduler, or `local`. `progress` is called with the number of searches done and that of all.

    **Raises** `InputError` where nothing is free, for recordings that cannot be used, for what a plan cannot be and for
    a folder that holds something else.
    """
    vehicles = {vehicle.layout.name: vehicle} if isinstance(vehicle, AbstractVehicle) else dict(vehicle)
    for name, one in vehicles.items():
        require_free(one, name)
    runs = [checked(one, recordings).recordings for one in vehicles.values()]
    if not runs:
        raise InputError("sweep: vehicles", "there are none", "give at least one")
    plan = planned(
        vehicles,
        runs[0],
        starts=starts,
        spread=spread,
        noise_seeds=noise_seeds,
        apart=apart,
        method=method,
        seed=seed,
        compiled=compiled,
    )
    if cluster is not None:
        require_cluster(cluster)
    if folder is not None:
        check_folder(Path(folder), plan)
        found = _swept(plan, Path(folder), cluster, progress)
        found.keep(Path(folder))
        return found
    with tempfile.TemporaryDirectory() as place:
        return _swept(plan, Path(place), cluster, progress)


def planned(
    vehicles: Mapping[str, AbstractVehicle],
    recordings: Sequence[Recording],
    *,
    starts: int,
    spread: float,
    noise_seeds: int,
    apart: bool,
    method: str,
    seed: int,
    compiled: bool,
) -> Plan:
    """The plan of a sweep on checked recordings; arguments as of `sweep`. **Raises** `InputError` as that does."""
    if len({recording.name for recording in recordings}) < len(recordings):
        where = ", ".join(dict.fromkeys(recording.source for recording in recordings))
        raise InputError(where, "two runs have one name", "rename one of the files")
    require_memory(vehicles, _sets(recordings, apart), starts, noise_seeds)
    if noise_seeds:
        recordings = answered(next(iter(vehicles.values())), recordings)
    return Plan(
        vehicles,
        _sets(recordings, apart),
        starts,
        spread=spread,
        noise=range(noise_seeds),
        seed=seed,
        method=method.replace("-", "_"),
        compiled=compiled,
    )


def _sets(recordings: Sequence[Recording], apart: bool) -> dict[str, Sequence[Recording]]:
    """The recordings that are fitted together, by name."""
    return {recording.name: [recording] for recording in recordings} if apart else {_TOGETHER: recordings}


def _swept(plan: Plan, folder: Path, cluster: str | None, progress: Callable[[int, int], None]) -> "Sweep":
    dataset = run_plan(plan, folder, cluster=cluster, progress=progress)
    return Sweep(dataset, summarised(plan, dataset))


@final
@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class Sweep(AbstractResult):
    """Where searches from many starts ended.

    **Fields**

    - `dataset`: every search over (vehicle, recording, noise, start), as `sweeps.open_sweep` has it.
    - `content`: success rates, basins and coefficients of each case, as `sweep.json` has them.
    """

    dataset: "xarray.Dataset"
    content: dict[str, Any]

    @classmethod
    def load(cls, folder: str | Path) -> "Sweep":
        """The sweep in `folder`, written by the command or from Python. **Raises** `InputError` where there is none."""
        import xarray

        place = Path(folder)
        try:
            content = json.loads((place / RESULT).read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(str(place / RESULT), "cannot be read", "give the folder of a finished sweep") from error
        whole = place / DATA
        return cls(xarray.load_dataset(whole, engine="h5netcdf") if whole.exists() else open_sweep(place), content)

    @property
    def cases(self) -> list[dict[str, Any]]:
        """What each vehicle on each set of recordings comes to."""
        return self.content["cases"]

    def brief(self) -> Parts:
        """How many searches succeeded in each case, and the coefficients."""
        return [part for case in self.cases for part in (_success(case), _coefficients(case))]

    def parts(self) -> Parts:
        """The same with verdicts, basins and outcomes."""
        return [part for case in self.cases for part in (*_lines(case), _coefficients(case))]

    def plot(self, case: int = 0) -> "Picture":
        """How high the searches of a case ended, and where."""
        from ..report import sweep_pictures

        chosen = self.content | {"cases": [self.cases[case]]}
        return sweep_pictures(self.dataset, chosen)[0]

    def to_xarray(self) -> "xarray.Dataset":
        """Every search over (vehicle, recording, noise, start)."""
        return self.dataset

    def to_dataframe(self) -> "pandas.DataFrame":
        """A row for each coefficient of each case: file value, best estimate, standard error, unit."""
        import pandas

        columns = ("file_value", "best", "standard_error", "unit")
        rows = [
            (case["vehicle"], case["recording"], name, *(numbers[column] for column in columns))
            for case in self.cases
            for name, numbers in case["coefficients"].items()
        ]
        index = ["vehicle", "recording", "coefficient"]
        return pandas.DataFrame(rows, columns=[*index, *columns]).set_index(index)

    def keep(self, folder: Path) -> None:
        """Put `sweep.json` and `figures/` into the `folder` in which the searches are kept."""
        from ..report import sweep_pictures

        store = Store(folder, self.content["plan"])
        for picture in sweep_pictures(self.dataset, self.content):
            store.keep(folder / FIGURES / f"{picture.name}.png", picture.png)
        store.keep(folder / RESULT, to_json(self.content).encode())

    def write(self, folder: Path) -> None:
        """Write `sweep.json`, `sweep.nc` and `figures/` into `folder`."""
        from ..report import sweep_pictures, write_figures

        (folder / RESULT).write_text(to_json(self.content), encoding="utf-8")
        self.dataset.to_netcdf(folder / DATA, engine="h5netcdf")
        write_figures(sweep_pictures(self.dataset, self.content), folder)


def _title(case: dict[str, Any]) -> str:
    return f"{case['vehicle']} on {case['recording']}"


def _success(case: dict[str, Any]) -> str:
    rate, (low, high) = case["success"], case["success"]["interval"]
    return (
        f"{_title(case)}: {rate['successes']} of {rate['count']} searches reach the least cost known"
        f" ({100 * rate['share']:.1f} %, 95 % interval {100 * low:.1f} to {100 * high:.1f} %)"
    )


def _lines(case: dict[str, Any]) -> list[str]:
    some = case["success"]["count"] > case["basins_of"]
    among = f"{case['basins_of']} searches" + (" with the first seed of noise" if some else "")
    return [
        f"{_title(case)}: the best estimate {case['assessment']['verdict']}",
        _success(case),
        f"basins found: {case['basins_found']} among {among}: "
        + ", ".join(f"{basin['count']} at cost {basin['cost']:.6g}" for basin in case["basins"]),
        "outcomes: " + ", ".join(f"{count} {name.replace('_', ' ')}" for name, count in case["outcomes"].items()),
    ]


def _coefficients(case: dict[str, Any]) -> Table:
    bootstrap = any("spread_over_noise" in numbers for numbers in case["coefficients"].values())
    heads, rows = ["coefficient", "best", "standard error", "5 to 95 % of ends"], []
    for name, numbers in case["coefficients"].items():
        ends = numbers["percentiles_5_50_95"]
        reach = f"{ends[0]:.6g} to {ends[2]:.6g}" if ends else "none"
        row = [name, _said(numbers["best"], 6), _said(numbers["standard_error"], 2), reach]
        rows.append([*row, *([_said(numbers["spread_over_noise"], 2)] if bootstrap else [])])
    return Table([*heads, *(["spread over noise"] * bootstrap)], rows)


def _said(value: float | None, digits: int) -> str:
    return "none" if value is None else f"{value:.{digits}g}"
