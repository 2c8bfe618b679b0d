"""Paths of the data that ship with the package: inside the wheel, or beside the package in a checkout."""

from pathlib import Path


def data_path(relative: str) -> Path:
    """Return the path of an embedded data file.

    Parameters
    ----------
    relative:
        Path below `data/`, such as ``"published/table_09_stiffness.csv"``.

    Raises
    ------
    FileNotFoundError
        If neither the installed package nor the checkout holds the file.
    """
    package = Path(__file__).resolve().parent
    for root in (package / "data", package.parent / "data"):
        if (root / relative).exists():
            return root / relative
    raise FileNotFoundError(f"embedded data file {relative!r} is missing from this installation")
