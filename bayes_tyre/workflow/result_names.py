"""Names of results that are compared: the ends of their folders' paths."""

from collections.abc import Sequence
from pathlib import Path

from bayes_tyre.errors import BadInput

#: What `report` writes into the folder of one result.
REPORTS = ("report.html", "report.pdf")
#: The table of models that `compare` writes into its folder.
COMPARISON = "comparison.csv"


def names(folders: Sequence[Path]) -> list[str]:
    """Return names of results: the shortest ends of their paths that are distinct.

    Raises
    ------
    BadInput
        If a folder is named twice.
    """
    whole = [folder.resolve() for folder in folders]
    twice = next((folder for folder, path in zip(folders, whole, strict=True) if whole.count(path) > 1), None)
    if twice is not None:
        raise BadInput(f"{twice}: is named twice; name each folder once")
    most = max(len(path.parts) for path in whole)
    ends = (["/".join(path.parts[-length:]) for path in whole] for length in range(1, most + 1))
    return next(labels for labels in ends if len(set(labels)) == len(labels))
