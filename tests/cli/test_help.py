"""What the help of commands lists is what there is: suffixes of files, force laws."""

from typing import get_args, get_type_hints

import pytest
from typer.testing import CliRunner

from bayes_tyre.cli import app, suffixes
from bayes_tyre.cli.commands import study
from bayes_tyre.cli.commands.motion import motion
from bayes_tyre.cli.commands.study import RankedLaw
from bayes_tyre.cli.model_options import LawOption, MotionLaw
from bayes_tyre.formats.recordings import raw
from bayes_tyre.formats.tables import table_files as tables
from bayes_tyre.inference.motion.laws import FANCHER, MOTION_LAWS
from bayes_tyre.inference.record_data import LAWS
from bayes_tyre.report.answer import caveats
from bayes_tyre.studies.law_ranking import RANKED_LAWS
from bayes_tyre.workflow.from_results.predict import EQUATIONS


def test_help_names_the_suffixes_that_are_read():
    assert suffixes.TABLE.replace(" or ", ", ").split(", ") == list(tables.READERS)
    assert suffixes.RAW.split(", ") == [suffix for suffix in raw.READERS if suffix != ".txt"]


def test_help_names_the_laws_that_a_motion_can_be_fitted_with():
    assert get_args(MotionLaw) == tuple(MOTION_LAWS)
    assert motion.__doc__ is not None
    assert all(law in motion.__doc__ for law in MOTION_LAWS if law != "fancher")


def test_every_law_along_a_record_can_be_asked_for_named_and_predicted_by():
    choices = get_args(get_args(LawOption)[0])
    assert choices == tuple(LAWS) == tuple(EQUATIONS) == tuple(caveats._LAWS)


def test_studies_take_the_laws_that_they_can_compare():
    assert [law.value for law in RankedLaw] == list(RANKED_LAWS)
    choices = get_args(get_type_hints(study.motion)["law"])
    of_a_record = {name: law for name, law in MOTION_LAWS.items() if not law.pools}
    assert choices == tuple(name for name, law in of_a_record.items() if law.reported == FANCHER.reported)


@pytest.mark.parametrize("group", [(), ("study",)], ids=["commands", "studies"])
def test_lists_of_commands_cut_no_description(group):
    listed = CliRunner().invoke(app, [*group, "--help"])
    assert listed.exit_code == 0
    descriptions = " ".join(listed.output.partition("Commands:")[2].split())
    assert descriptions.endswith(".")
    assert "..." not in descriptions.replace(", ...)", ")")
