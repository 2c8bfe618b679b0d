"""The records of a posterior are taken in its order, and no others for them."""

import pandas as pd
import pytest
from helpers.command_line import small
from helpers.quick_fits import drawn

from bayes_tyre.errors import BadInput
from bayes_tyre.inference.model.prepared_records import record_batch, used_points
from bayes_tyre.inference.sampling.datatree import RECORDS_DIGEST
from bayes_tyre.record_table import check_record_table
from bayes_tyre.results.fitted_records import fitted_records

TABLE = check_record_table(small())


def tree_of(region: str = "all"):
    tree = drawn(TABLE)
    tree.attrs |= {"region": region, RECORDS_DIGEST: record_batch(used_points(TABLE, region)).digest}
    return tree


@pytest.mark.parametrize("region", ["all", "thesis"])
def test_records_come_in_the_order_of_the_posterior_with_all_their_points(region):
    backwards = pd.concat([rows for _, rows in sorted(TABLE.groupby("record"), reverse=True)], ignore_index=True)
    pd.testing.assert_frame_equal(fitted_records(tree_of(region), backwards), TABLE)


def test_other_records_and_other_readings_are_refused():
    with pytest.raises(BadInput, match="not the records that the posterior was fitted to"):
        fitted_records(tree_of(), TABLE[TABLE["record"] != TABLE["record"].iloc[0]])
    with pytest.raises(BadInput, match="the readings are not those"):
        fitted_records(tree_of(), TABLE.assign(force_kN=TABLE["force_kN"] + 0.5))
