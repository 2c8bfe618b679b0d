"""Options of the commands that process raw files."""

from pathlib import Path
from typing import Annotated

import typer

from bayes_tyre.cli import suffixes

RawFiles = Annotated[
    list[Path], typer.Argument(metavar="RAW...", help=f"Raw files ({suffixes.RAW}), or folders of them.")
]
RigName = Annotated[
    str | None,
    typer.Option(help="Rig: single, dual, or a TOML file, where --cases names none; default: the configuration's own."),
]
CasesTable = Annotated[
    Path | None,
    typer.Option(
        help=f"Table ({suffixes.TABLE}) with file, configuration, speed_km_h (km/h), initial_load_kN, step_kN (kN), "
        "repeat, and rig where wanted: single, dual, or a TOML file, its path from the table's folder; default: from "
        "names such as DynamicS(0)30-20(1).lvm."
    ),
]
Workers = Annotated[int | None, typer.Option(min=1, help="Processes; default: one a core.")]
Cluster = Annotated[
    str | None,
    typer.Option(
        metavar="ADDRESS",
        help="Scheduler of a dask cluster, such as tcp://host:8786, to work there instead of here; its workers "
        "must see the files under the same paths.",
    ),
]


def check_machines(workers: int | None, cluster: str | None) -> None:
    """Refuse --workers beside --cluster, which has workers of its own."""
    if cluster is not None and workers is not None:
        raise typer.BadParameter("goes with no --workers: the cluster has its own", param_hint="--cluster")
