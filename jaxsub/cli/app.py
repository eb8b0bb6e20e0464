"""Commands of `jaxsub` (formats.md)."""

import sys
from pathlib import Path
from typing import Annotated

import click
import typer

from ..errors import InputError

app = typer.Typer(
    add_completion=False, no_args_is_help=True, help="Fit a vehicle to recordings, and name the physics it leaves out."
)

Vehicle = Annotated[Path, typer.Argument(help="Vehicle file (.toml).")]
Runs = Annotated[list[Path], typer.Argument(help="Recordings (.csv, .parquet, .nc), one run a file.")]
Out = Annotated[Path, typer.Option(help="Where the results go.")]
Overwrite = Annotated[bool, typer.Option(help="Replace what is at --out.")]


@app.command()
def demo(
    out: Out = Path("jaxsub-demo"),
    seed: Annotated[int, typer.Option(help="Which effect is concealed, and the noise.")] = 0,
    overwrite: Overwrite = False,
) -> None:
    """Make recordings that conceal an effect, and diagnose them."""
    from . import demo as command

    command.run(out, seed, overwrite)


@app.command()
def identify(vehicle: Vehicle, runs: Runs, out: Out, overwrite: Overwrite = False) -> None:
    """Estimate the free coefficients, with standard errors and identifiability."""
    from . import identify as command

    command.run(vehicle, runs, out, overwrite)


@app.command()
def diagnose(
    vehicle: Vehicle,
    runs: Runs,
    out: Out,
    hold_out: Annotated[list[Path] | None, typer.Option(help="A run to judge by and not to fit; repeatable.")] = None,
    overwrite: Overwrite = False,
) -> None:
    """Fit, locate the mismatch, name the missing physics, model it, and show it on held-out runs."""
    from . import diagnose as command

    command.run(vehicle, runs, hold_out or [], out, overwrite)


@app.command()
def simulate(vehicle: Vehicle, run: Path, out: Out, overwrite: Overwrite = False) -> None:
    """Write the model's answer to a recording's inputs, as a recording."""
    from . import simulate as command

    command.run(vehicle, run, out, overwrite)


def main() -> None:
    """The `jaxsub` command: exit 0 done, 2 bad input with one line on stderr, 1 anything else."""
    try:
        app(standalone_mode=False)
    except InputError as error:
        _stop(f"jaxsub: {error}", 2)
    except click.UsageError as error:
        _stop(f"jaxsub: {' '.join(error.format_message().split())}; see jaxsub --help", 2)
    except (KeyboardInterrupt, click.Abort):
        _stop("jaxsub: interrupted; nothing was written", 1)
    except Exception as error:
        _stop(f"jaxsub: {type(error).__name__}: {' '.join(str(error).split())[:500]}", 1)


def _stop(message: str, code: int) -> None:
    print(message, file=sys.stderr)
    sys.exit(code)
