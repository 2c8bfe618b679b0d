"""The commands of `bayes-tyre`. Whatever computes is imported inside a command: `--help` must not wait for JAX."""

from importlib.metadata import version
from typing import Annotated

import typer

from bayes_tyre.cli.audit import audit
from bayes_tyre.cli.calibrate import calibrate
from bayes_tyre.cli.compare import compare
from bayes_tyre.cli.fit import fit
from bayes_tyre.cli.inspect import inspect
from bayes_tyre.cli.load_deflection import load_deflection
from bayes_tyre.cli.lsq import lsq
from bayes_tyre.cli.motion import motion
from bayes_tyre.cli.predict import predict
from bayes_tyre.cli.process import process
from bayes_tyre.cli.published import campaign, published
from bayes_tyre.cli.report import report
from bayes_tyre.cli.shell import Command, guarded
from bayes_tyre.cli.show import show
from bayes_tyre.cli.simulate import simulate
from bayes_tyre.cli.study import study

app = typer.Typer(
    name="bayes-tyre",
    help="Identify the stiffness k (kN/mm) and characteristic deflection beta (mm) of tyres, with honest uncertainty.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@app.callback(invoke_without_command=True)
def main(show_version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False) -> None:
    """Identify the stiffness and hysteresis of tyres."""
    if show_version:
        typer.echo(version("bayes-tyre"))
        raise typer.Exit


_FITS = (lsq, load_deflection, fit, motion)
_SIMULATED = (simulate, audit)
for command in (published, campaign, inspect, calibrate, process, *_FITS, compare, predict, report, show, *_SIMULATED):
    app.command(cls=Command)(guarded(command))
app.add_typer(study)

if __name__ == "__main__":
    app()
