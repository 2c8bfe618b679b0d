"""A short run of the fuzzing of every reader that `make fuzz` does for long."""

import pytest
from helpers.fuzz_readers import READERS, fuzz, outcome


@pytest.mark.parametrize("name", READERS)
def test_nothing_but_a_result_or_the_one_error(name, tmp_path):
    counts = fuzz(READERS[name], 60, tmp_path, start=20190301)
    assert counts.total() >= 60
    assert counts["refused"] > 0


@pytest.mark.parametrize("name", [name for name in READERS if name != "priors.toml"])
def test_what_the_mutations_begin_with_is_read(name, tmp_path):
    reader = READERS[name]
    assert "read" in [outcome(reader, data, tmp_path) for data in reader.seeds(tmp_path)]
