"""The example machines of `data/rigs/README.md`, read from that page."""

import re
import tomllib

from bayes_tyre.embedded import data_path
from bayes_tyre.rig.axle import Rig


def readme_texts() -> dict[str, str]:
    """Return the TOML text of each example by its rig's name."""
    page = data_path("rigs/README.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```toml\n(.*?)^```$", page, re.DOTALL | re.MULTILINE)
    return {str(tomllib.loads(block)["name"]): block for block in blocks}


def readme_rig(name: str) -> Rig:
    return Rig.model_validate(tomllib.loads(readme_texts()[name]))
