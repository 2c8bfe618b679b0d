"""The published tables, recomputed, and the records reconstructed from them."""

from pathlib import Path

import pandas as pd

from bayes_tyre.embedded import data_path
from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import check_folder, prepare_folder
from bayes_tyre.formats.tables.table_files import WRITERS, read_table, write_table
from bayes_tyre.inference.least_squares.table import FitSettings, fit_records
from bayes_tyre.published import campaign, checks
from bayes_tyre.record_table import check_record_table

CAMPAIGN = "campaign/records.csv"


def write_campaign(out: Path, seed: int | None = None) -> tuple[Path, Path]:
    """Write the reconstructed campaign to `out` and its truth beside it; return both paths.

    Raises
    ------
    BadInput
        If the suffix of `out` is not that of a record table.
    """
    if out.suffix.lower() not in WRITERS:
        raise BadInput(f"--out {out}: {out.suffix or 'no suffix'} is not a table format; use {' or '.join(WRITERS)}")
    truth = out.with_name(f"{out.stem}_truth{out.suffix}")
    check_folder(out.parent)
    if taken := next((path for path in (out, truth) if path.is_dir()), None):
        raise BadInput(f"--out {out}: {taken} is a folder; name another file")
    made = campaign.reconstruct(campaign.SEED if seed is None else seed)
    return write_table(made.records, out), write_table(made.truth, truth)


def check_published(out: Path) -> pd.DataFrame:
    """Write `published_check.csv` into `out`; return it. The round trip goes through the embedded campaign."""
    prepare_folder(out)
    records = check_record_table(read_table(data_path(CAMPAIGN)), CAMPAIGN)
    fits = fit_records(records, FitSettings(region="thesis"))
    check = checks.published_check(campaign.case_means(fits))
    write_table(check, out / "published_check.csv")
    return check


def agreement_lines(check: pd.DataFrame) -> list[str]:
    """Return how many numbers of each kind agree with the source, a line a kind."""
    counts = check.groupby("kind", sort=False)["agrees"].agg(["sum", "size"])
    return [f"{kind}: {agree} of {size} agree" for kind, (agree, size) in counts.iterrows()]
