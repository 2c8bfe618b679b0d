"""One-line messages for errors in a rig file: the key as in the file, and the remedy."""

import re
from collections.abc import Mapping, Sequence
from difflib import get_close_matches

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

EXPLAINED = "the keys are explained in data/rigs/README.md"


def first_fault(
    error: ValidationError, model: type[BaseModel], content: Mapping[str, object], explained: str = EXPLAINED
) -> str:
    """Return what is wrong with the first key that is unknown, else with the first that is missing or wrong.

    Of a misspelt key it says which key is meant: one of the model that is not in the file's content. That one is not
    counted as missing.
    """
    faults = sorted(error.errors(), key=lambda fault: fault["type"] != "extra_forbidden")
    first, *others = faults
    near = _near(first, model, content) if first["type"] == "extra_forbidden" else ""
    meant = (*first["loc"][:-1], near)
    count = sum(not (other["type"] == "missing" and other["loc"] == meant) for other in others)
    more = f" (and {count} more)" if count else ""
    unknown = "mend its spelling or remove it" + (f" (did you mean {_spelt(meant)}?)" if near else "")
    messages = {"missing": ("is missing", "add it"), "extra_forbidden": ("is unknown", unknown)}
    wrong = f"{first['msg'][0].lower()}{first['msg'][1:]}, not {repr(first['input'])[:40]}", "mend the value"
    what, remedy = messages.get(first["type"], wrong)
    return f"key {_spelt(first['loc'])}: {what}{more}; {remedy}, {explained}"


def _spelt(keys: Sequence[str | int]) -> str:
    return ".".join(part if re.fullmatch(r"[\w-]+", part, re.ASCII) else repr(part) for part in map(str, keys))


def _near(fault: ErrorDetails, model: type[BaseModel], content: Mapping[str, object]) -> str:
    """Return the key that is not given and is spelt most like the unknown one of its section; empty where none is."""
    *above, key = map(str, fault["loc"])
    for name in above:
        field = model.model_fields[name].annotation
        kinds = [field, *getattr(field, "__args__", ())]  # a section that may be left out is one of two
        model = next(kind for kind in kinds if isinstance(kind, type) and issubclass(kind, BaseModel))
        section = content[name]
        content = section if isinstance(section, Mapping) else {}
    return next(iter(get_close_matches(key, model.model_fields.keys() - content.keys(), n=1)), "")
