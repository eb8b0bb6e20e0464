"""The commands of `jaxsub`."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
from click.shell_completion import get_completion_class

from . import process
from .options import common
from .quantity import dimensions

_PATH = process.Location()
# said here and not asked of `estimate`, so that `--help` needs no jax; a test holds the two together
METHODS = ("gauss-newton", "newton", "newton-eq10", "nelder-mead", "gradient", "mekf", "ekf")
STARTS = ("rest", "recorded", "estimated")
_SENSORS = "sensors"
KINDS = ("auv", "glider", "rov", "ship", "usv")
_RIG = "rig"
SHELLS = ("bash", "zsh", "fish")
PUBLISHED = (
    "bluerov2-heavy", "dsrv", "kvlcc2", "nps-auv-ii", "otter", "remus-100", "remus-100-linear", "rexrov", "seaglider",
    "slocum", "suboff", "torpedo",
)  # fmt: skip
_vehicle = click.argument("vehicle", type=_PATH)
_runs = click.argument("runs", type=_PATH, nargs=-1, required=True)
_columns = click.option("--columns", type=_PATH, help="A TOML file that says which channels of a log to take.")
_cluster = click.option(
    "--cluster", metavar="ADDRESS", help="A Dask scheduler, or local for one worker a core of this machine."
)
_overwrite = click.option("--overwrite", is_flag=True, help="Replace what jaxsub wrote at --out before.")


def _out(**settings: object) -> Callable:
    return click.option("--out", type=_PATH, help="Where the results go.", **settings)  # pyright: ignore[reportArgumentType]


def _print_versions(context: click.Context, parameter: click.Parameter, wanted: bool) -> None:
    """Print the versions of what computes, and the device that commands compute on."""
    if not wanted or context.resilient_parsing:
        return
    from . import run_log, session

    session.choose_device()
    for name, version in (*run_log.versions().items(), ("device", run_log.device())):
        click.echo(f"{name} {version}")
    context.exit()


@click.group(
    cls=process.Commands, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]}
)
@click.option(
    "--version", is_flag=True, is_eager=True, expose_value=False, callback=_print_versions, help="Show versions."
)
@common
@click.pass_context
def app(context: click.Context) -> None:
    """Fit a vehicle to recordings, and name the physics it leaves out.

    --quiet, --json, --strict and --debug may stand before the command or after it.
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@app.command()
@_out(default=Path("jaxsub-demo"), show_default=True)
@click.option("--seed", default=0, show_default=True, help="Which effect is concealed, and the noise.")
@_overwrite
@common
def demo(out: Path, seed: int, overwrite: bool) -> None:
    """Make recordings that conceal an effect, and diagnose them."""
    from . import demo as command

    command.run(out, seed, overwrite)


@app.command()
@_vehicle
@_runs
@_out(required=True)
@click.option("--method", type=click.Choice(METHODS), default=METHODS[0], show_default=True)
@click.option("--posterior", is_flag=True, help="Draw from the posterior too, into posterior.nc.")
@_columns
@_overwrite
@common
def identify(
    vehicle: Path,
    runs: tuple[Path, ...],
    out: Path,
    method: str,
    posterior: bool,
    columns: Path | None,
    overwrite: bool,
) -> None:
    """Estimate the free coefficients, with standard errors and identifiability."""
    from . import identify as command

    command.run(vehicle, runs, out, method, overwrite, columns, posterior)


@app.command()
@_vehicle
@_runs
@_out()
@click.option("--hold-out", type=_PATH, multiple=True, help="A test run, read once after every decision; repeatable.")
@_columns
@_overwrite
@common
def check(
    vehicle: Path,
    runs: tuple[Path, ...],
    hold_out: tuple[Path, ...],
    out: Path | None,
    columns: Path | None,
    overwrite: bool,
) -> None:
    """Say what is wrong or odd with the runs, before any fit."""
    from . import check as command

    command.run(vehicle, runs, hold_out, out, overwrite, columns)


@app.command()
@_vehicle
@_runs
@_out(required=True)
@click.option("--hold-out", type=_PATH, multiple=True, help="A test run, read once after every decision; repeatable.")
@click.option("--effects", type=_PATH, help="A Python script with effects of your own, to be tried too.")
@click.option("--manoeuvre/--no-manoeuvre", default=True, help="Where rivals remain, look for the run that settles it.")
@click.option("--budget", metavar="SECONDS", type=click.FloatRange(0.0), help="End with the answer so far after these.")
@click.option("--begin", type=_PATH, help="improved.toml of an incomplete answer, to go on from.")
@click.option("--explain", is_flag=True, help="Print every decision: its test, statistic, threshold and outcome.")
@_cluster
@_columns
@_overwrite
@common
def diagnose(
    vehicle: Path,
    runs: tuple[Path, ...],
    out: Path,
    hold_out: tuple[Path, ...],
    effects: Path | None,
    manoeuvre: bool,
    budget: float | None,
    begin: Path | None,
    explain: bool,
    cluster: str | None,
    columns: Path | None,
    overwrite: bool,
) -> None:
    """Fit, locate the mismatch, name the missing physics, model it, and show it on test runs."""
    from . import diagnose as command

    command.run(vehicle, runs, hold_out, out, overwrite, effects, manoeuvre, columns, explain, budget, begin, cluster)


@app.command()
@_vehicle
@click.argument("run", type=_PATH)
@_out(required=True)
@click.option("--start", type=click.Choice(STARTS), default=STARTS[-1], show_default=True, help="The initial state.")
@_columns
@_overwrite
@common
def simulate(vehicle: Path, run: Path, out: Path, start: Any, columns: Path | None, overwrite: bool) -> None:
    """Write the model's answer to a recording's inputs, as a recording, and show its errors."""
    from . import simulate as command

    command.run(vehicle, run, out, overwrite, columns, start)


@app.command()
@click.argument("log", type=_PATH)
@click.option("--sensors", type=_PATH, required=True, help="A TOML file that describes the sensors.")
@click.option("--reference", type=_PATH, help="A recording of the true motion on the log's clock, for errors.")
@_out(required=True)
@_overwrite
@common
def navigate(log: Path, sensors: Path, reference: Path | None, out: Path, overwrite: bool) -> None:
    """Attitude, velocity and position with standard deviations, from the raw sensors of a log."""
    from . import navigate as command

    command.run(log, sensors, out, overwrite, reference)


@app.command()
@_vehicle
@_runs
@_out(required=True)
@click.option(
    "--outage", "outages", metavar="CHANNEL:FROM:TO", multiple=True, help="Channels, from and to s; repeatable."
)
@click.option("--improved", type=_PATH, help="A further vehicle file, to compare in the outages.")
@_columns
@_overwrite
@common
def filter(
    vehicle: Path,
    runs: tuple[Path, ...],
    out: Path,
    outages: tuple[str, ...],
    improved: Path | None,
    columns: Path | None,
    overwrite: bool,
) -> None:
    """Estimate states with the vehicle's dynamics as motion model, filtered and smoothed, with their bands."""
    from . import filter as command

    command.run(vehicle, runs, out, outages, improved, overwrite, columns)


@app.command()
@_vehicle
@click.argument("source", default="-")
@click.option("--clean", type=_PATH, multiple=True, help="A run without faults, to calibrate on; repeatable.")
@click.option(
    "--false-alarms-per-hour", type=click.FloatRange(1e-6, 60.0), default=0.01, show_default=True,
    help="The rate of false alarms that sets the threshold.",
)  # fmt: skip
@click.option("--state", type=_PATH, help="A file of the state, by which a new process goes on.")
@click.option("--header", help="Header of the columns, for a source that sends none.")
@click.option("--longest", metavar="SECONDS", type=click.FloatRange(1.0), default=3600.0, show_default=True,
              help="The longest time over which a change may gather.")  # fmt: skip
@click.option("--interval", metavar="SECONDS", type=click.FloatRange(1e-4), help="Usual time between samples.")
@click.option("--status-every", metavar="SECONDS", type=click.FloatRange(1.0), default=600.0, show_default=True,
              help="Time between two reports of what was wrong with the stream.")  # fmt: skip
@_out()
@common
def watch(vehicle: Path, source: str, **arguments: Any) -> None:
    """Watch a vehicle's stream sample by sample; alarms as JSON lines.

    SOURCE is a CSV file, - for standard input, udp://HOST:PORT or serial:DEVICE.
    """
    from . import watch as command

    command.run(vehicle, source, command.Asked(**arguments))


@app.command()
@click.argument("kind", type=click.Choice((*KINDS, _RIG, _SENSORS)), required=False)
@click.argument("sensor_log", type=_PATH, required=False)
@dimensions
@click.option("--like", type=process.Name(PUBLISHED), help="A published vehicle in place of a kind.")
@click.option("--log", type=_PATH, help="A recording whose columns are the inputs and outputs.")
@_columns
@_out()
@_overwrite
@common
def init(
    kind: str | None,
    sensor_log: Path | None,
    like: str | None,
    log: Path | None,
    columns: Path | None,
    out: Path | None,
    overwrite: bool,
    **sizes: Any,
) -> None:
    """Begin a vehicle file: coefficients estimated from dimensions, with their uncertainty and source.

    `jaxsub init rig --log RUN` begins a mechanism by the columns of a log. `jaxsub init sensors LOG` begins a sensor
    file for `jaxsub navigate`, by the names of a log's columns.
    """
    if kind == _SENSORS:
        from . import init_sensors

        options = {"like": like, "log": log, "columns": columns, **sizes}
        init_sensors.run(sensor_log, [name for name, value in options.items() if value is not None], out, overwrite)
        return
    if sensor_log is not None:
        raise click.UsageError(f"{sensor_log} is given beside a vehicle; give a log as --log {sensor_log}")
    from . import init as command

    given = {name: size for name, size in sizes.items() if size is not None}
    command.run(kind, like, given, log, columns, out, overwrite)


@app.command("import")
@click.argument("file", type=_PATH)
@_out(required=True)
@_overwrite
@common
def import_(file: Path, out: Path, overwrite: bool) -> None:
    """Write a Gazebo model (SDF) or MSS matrices (.mat) as a vehicle file, and name what of it is not translated."""
    from . import simulators as command

    command.run_import(file, out, overwrite)


@app.command()
@_vehicle
@click.option("--sdf", type=_PATH, required=True, help="Where the model for Gazebo goes.")
@_overwrite
@common
def export(vehicle: Path, sdf: Path, overwrite: bool) -> None:
    """Write a vehicle as a model for Gazebo (SDF), and name what of it is not translated."""
    from . import simulators as command

    command.run_export(vehicle, sdf, overwrite)


@app.command()
@click.argument("log", type=_PATH)
@click.argument("words", nargs=-1)
@common
def channels(log: Path, words: tuple[str, ...]) -> None:
    """List the channels of a log or the columns of a file, or those whose names hold one of the words."""
    from . import channels as command

    command.run(log, words)


@app.command()
@_vehicle
@_runs
@_out(required=True)
@click.option("--starts", type=click.IntRange(1), required=True, help="How many initial guesses.")
@click.option("--spread", type=click.FloatRange(0.0), default=0.5, show_default=True, help="0.5 draws within ±50 %.")
@click.option(
    "--noise-seeds", type=click.IntRange(0), default=0, help="Bootstrap: answers with noise drawn this often."
)
@click.option("--vehicle", "others", type=_PATH, multiple=True, help="A further vehicle on the same runs; repeatable.")
@click.option("--apart", is_flag=True, help="Fit every run on its own instead of all together.")
@click.option("--method", type=click.Choice(METHODS), default=METHODS[0], show_default=True)
@click.option("--seed", type=click.IntRange(0, 2**31 - 1), default=0, show_default=True, help="Of all draws.")
@click.option("--compiled", is_flag=True, help="By C made of the model: many times faster; needs .[control] and cc.")
@_cluster
@_overwrite
@common
def sweep(out: Path, overwrite: bool, **arguments: Any) -> None:
    """Monte-Carlo over initial guesses; goes on with what is in --out already."""
    from . import sweep as command

    command.run(command.Asked(**arguments), out, overwrite)


@app.command()
@click.argument("folder", metavar="DIR", type=_PATH)
@common
def report(folder: Path) -> None:
    """Draw the page and figures of a diagnosis in DIR again."""
    from . import report as command

    command.run(folder)


@app.command()
@click.argument("shell", type=click.Choice(SHELLS))
@common
def completion(shell: str) -> None:
    """Print a script by which SHELL completes commands, options and paths."""
    kind = get_completion_class(shell)
    assert kind is not None  # click knows each of SHELLS
    click.echo(kind(app, {}, "jaxsub", "_JAXSUB_COMPLETE").source())


def main() -> None:
    """The `jaxsub` command; `process.run` says what its exit codes mean."""
    process.run(app)
