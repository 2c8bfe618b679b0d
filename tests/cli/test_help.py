"""What the help of commands lists is what there is: suffixes of files, force laws."""

import pytest
from typer.testing import CliRunner

from bayes_tyre.cli import app, suffixes
from bayes_tyre.cli.commands.motion import Law, motion
from bayes_tyre.formats.recordings import raw
from bayes_tyre.formats.tables import table_files as tables
from bayes_tyre.inference.motion.laws import MOTION_LAWS


def test_help_names_the_suffixes_that_are_read():
    assert suffixes.TABLE.replace(" or ", ", ").split(", ") == list(tables.READERS)
    assert suffixes.RAW.split(", ") == [suffix for suffix in raw.READERS if suffix != ".txt"]


def test_help_names_the_laws_that_a_motion_can_be_fitted_with():
    assert [law.value for law in Law] == list(MOTION_LAWS)
    assert motion.__doc__ is not None
    assert all(law.value in motion.__doc__ for law in Law if law is not Law.fancher)


@pytest.mark.parametrize("group", [(), ("study",)], ids=["commands", "studies"])
def test_lists_of_commands_cut_no_description(group):
    listed = CliRunner().invoke(app, [*group, "--help"])
    assert listed.exit_code == 0
    descriptions = " ".join(listed.output.partition("Commands:")[2].split())
    assert descriptions.endswith(".")
    assert "..." not in descriptions.replace(", ...)", ")")
