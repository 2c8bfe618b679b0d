"""The console of the tables that commands print; a log file has them too."""

import logging
from typing import Any

from rich.console import Console


class LoggedConsole(Console):
    """Rich's console; what it prints goes, line by line, to the logger `bayes_tyre` as well."""

    def __init__(self, **options: Any) -> None:
        super().__init__(record=True, **options)

    def print(self, *objects: Any, **options: Any) -> None:
        """Print as rich does, then log the lines that are not blank."""
        super().print(*objects, **options)
        for line in filter(str.strip, self.export_text().splitlines()):
            logging.getLogger("bayes_tyre").debug("%s", line.rstrip())
