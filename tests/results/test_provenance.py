"""Which runs rest on the same records: by the content of their tables and recordings, not of the files beside them."""

import pytest

from bayes_tyre.results.provenance import share_records


def run(inputs: dict[str, str], **options: object) -> dict[str, object]:
    return {"options": options, "inputs": inputs}


@pytest.mark.parametrize(
    ("one", "other", "shared"),
    [
        (run({"a.csv": "a"}), run({"elsewhere/b.csv": "a"}), True),
        (run({"a.csv": "a", "b.csv": "b"}), run({"c.csv": "c", "b.csv": "b"}), True),
        (run({"a.csv": "a"}), run({"a.csv": "b"}), False),
        (run({"a.csv": "a", "lab.map": "m"}, columns={}), run({"b.csv": "b", "lab.map": "m"}, columns={}), False),
        (run({"b.xlsx#2025": "b"}), run({"b.xlsx#2026": "b"}), False),
        (run({"b.xlsx#2025": "b"}), run({"copy.xlsx#2025": "b"}), True),
        (run({"b.xlsx#2025": "b"}), run({"b.xlsx": "b"}), True),  # which sheet was read is not known
        (run({"a.lvm": "a", "my.rig": "r"}, rig="./my.rig"), run({"b.lvm": "b", "my.rig": "r"}, rig="my.rig"), False),
        (run({"a.csv": "a", "c.csv": "c"}, cases="c.csv"), run({"b.csv": "b", "c.csv": "c"}, cases="c.csv"), False),
        (run({"a.lvm": "a", "rig.toml": "r"}), run({"b.lvm": "b", "rig.toml": "r"}), False),
        (run({"a.lvm": "a", "rig.toml": "r"}, rig="rig.toml"), run({"a.lvm": "a"}), True),
        (run({"a.lvm": "a", "r": "r"}, rig_files=["r"]), run({"b.lvm": "b", "r": "r"}, rig_files=["r"]), False),
    ],
)
def test_only_inputs_with_records_count(one, other, shared):
    assert share_records(one, other) is shared
    assert share_records(other, one) is shared
