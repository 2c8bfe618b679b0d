"""The commands of `bayes-tyre`. A command imports what it computes with only when it runs: `--help` needs no JAX."""

from importlib.metadata import version
from typing import Annotated

import typer

from bayes_tyre.cli.commands.audit import audit
from bayes_tyre.cli.commands.fit import fit
from bayes_tyre.cli.commands.from_files.calibrate import calibrate
from bayes_tyre.cli.commands.from_files.columns import columns
from bayes_tyre.cli.commands.from_files.inspect import inspect
from bayes_tyre.cli.commands.from_files.process import process
from bayes_tyre.cli.commands.from_results.compare import compare
from bayes_tyre.cli.commands.from_results.export import export
from bayes_tyre.cli.commands.from_results.next import next as next_tests
from bayes_tyre.cli.commands.from_results.predict import predict
from bayes_tyre.cli.commands.from_results.report import report
from bayes_tyre.cli.commands.from_results.show import show
from bayes_tyre.cli.commands.load_deflection import load_deflection
from bayes_tyre.cli.commands.lsq import lsq
from bayes_tyre.cli.commands.modes import modes
from bayes_tyre.cli.commands.motion import motion
from bayes_tyre.cli.commands.published import campaign, published
from bayes_tyre.cli.commands.simulate import simulate
from bayes_tyre.cli.commands.study import study
from bayes_tyre.cli.shell import Command, first_paragraph, guarded

app = typer.Typer(
    name="bayes-tyre",
    help="Identify the stiffness k (kN/mm) and characteristic deflection beta (mm) of tyres, with their uncertainty.",
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


_INPUT = (inspect, calibrate, process, columns)
_FITS = (lsq, load_deflection, modes, fit, motion)
_READ_RESULTS = (compare, predict, next_tests, export, report, show)
_SIMULATED = (simulate, audit)
for command in (published, campaign, *_INPUT, *_FITS, *_READ_RESULTS, *_SIMULATED):
    app.command(cls=Command, short_help=first_paragraph(command))(guarded(command))
app.add_typer(study, short_help=study.info.help)

if __name__ == "__main__":
    app()
