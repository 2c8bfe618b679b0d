"""A short run of the fuzzing that `make fuzz` does for long."""

import pytest
from helpers.fuzz_lvm import SEEDS, fuzz, outcome
from helpers.lvm_dialects import BAD


@pytest.mark.slow
def test_nothing_but_raw_signals_or_the_one_error(tmp_path):
    counts = fuzz(600, tmp_path / "mutated.lvm", start=20190301)
    assert counts.total() >= 600
    assert min(counts["read"], counts["refused"]) > 60  # the mutations reach both ends


def test_what_the_mutations_begin_with(tmp_path):
    refused = [data for data in SEEDS if outcome(data, tmp_path / "seed.lvm") == "refused"]
    assert refused == [text.encode() for text in BAD.values()]
