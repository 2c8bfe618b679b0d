"""Files are written whole or not at all, and a folder that cannot be written to is refused before the work."""

import errno
import os
import subprocess
import sys
from pathlib import Path

import pytest
from helpers.permissions import permissions

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.files import check_folder, prepare_folder, whole_file, write_text


def write(path: Path, content: bytes) -> Path:
    path.write_bytes(content)
    return path


def test_a_whole_file_takes_its_place_and_leaves_nothing_beside(tmp_path):
    path = tmp_path / "new" / "result.csv"
    with whole_file(path) as beside:
        assert beside.parent == path.parent  # a rename within one file system
        assert not path.exists()
        beside.write_text("done")
    assert path.read_text() == "done"
    assert list(path.parent.iterdir()) == [path]


def test_a_block_that_raises_leaves_nothing_behind(tmp_path):
    with pytest.raises(KeyboardInterrupt), whole_file(tmp_path / "result.csv") as beside:  # noqa: PT012
        beside.write_text("half")
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_a_block_that_raises_leaves_the_old_file_as_it_was(tmp_path):
    path = write_text("old", tmp_path / "result.txt")
    with pytest.raises(ValueError, match="half way"), whole_file(path) as beside:  # noqa: PT012
        beside.write_text("new")
        raise ValueError("half way")
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_writing_again_replaces_the_old_file_with_its_usual_permissions(tmp_path):
    usual = write(tmp_path / "usual", b"").stat().st_mode
    path = write_text("old", tmp_path / "result.txt")
    assert write_text("⌀ new", path).read_bytes() == "⌀ new".encode()
    assert path.stat().st_mode == usual


def test_a_disk_that_refuses_is_told_with_the_file_s_own_name_and_leaves_nothing(tmp_path):
    path = tmp_path / "new" / "folder" / "result.csv"
    with pytest.raises(OSError, match="No space left on device") as caught, whole_file(path) as beside:  # noqa: PT012
        beside.write_text("half")
        raise OSError(errno.ENOSPC, "a library's own words", str(beside))
    assert (caught.value.errno, caught.value.filename) == (errno.ENOSPC, str(path))
    assert list(tmp_path.iterdir()) == []


def test_an_error_without_a_number_keeps_its_words(tmp_path):
    with pytest.raises(OSError, match="disk quota of the group") as caught, whole_file(tmp_path / "result.csv"):
        raise OSError("disk quota\nof the group")
    assert caught.value.filename == str(tmp_path / "result.csv")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_in_the_place_of_the_file_stays_and_nothing_is_left_beside(tmp_path):
    (tmp_path / "result.csv").mkdir()
    with pytest.raises(IsADirectoryError):
        write_text("new", tmp_path / "result.csv")
    assert list(tmp_path.iterdir()) == [tmp_path / "result.csv"]


def test_a_path_whose_bytes_are_no_text_can_be_written_about(tmp_path):
    path = write_text(os.fsdecode(b"caf\xe9"), tmp_path / "run.json")
    assert path.read_bytes() == rb"caf\udce9"


@pytest.mark.parametrize("below", ["", "deep/below"])
def test_a_folder_that_can_be_written_to_is_left_as_it_is(below, tmp_path):
    check_folder(tmp_path / below)
    assert list(tmp_path.iterdir()) == []
    prepare_folder(tmp_path / below)
    assert (tmp_path / below).is_dir()
    assert list((tmp_path / below).iterdir()) == []


@pytest.mark.parametrize("name", ["", "/below"])
def test_a_file_in_the_place_of_a_folder_is_refused(name, tmp_path):
    path = write(tmp_path / "file", b"")
    with pytest.raises(BadInput, match="is a file, or lies below one; name a folder"):
        check_folder(Path(f"{path}{name}"))


@pytest.mark.skipif(not Path("/proc/self").is_dir(), reason="no /proc: not Linux")
def test_a_place_where_nobody_may_write_is_refused():
    with pytest.raises(BadInput, match=r"--out /proc/x: /proc may not be written to \(.+\); name a folder"):
        check_folder(Path("/proc/x"))


@permissions
def test_a_folder_without_the_permission_to_write_is_refused(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(BadInput, match="Permission denied"):
        check_folder(tmp_path / "out")
    tmp_path.chmod(0o700)


def test_what_is_being_written_is_taken_back_when_the_process_ends_and_nothing_begins_or_ends_after(tmp_path):
    script = """
import threading, sys
from pathlib import Path
from bayes_tyre.formats.files import remove_unfinished, whole_file, write_text
folder = Path(sys.argv[1])
write_text("old", folder / "one")
def late():
    try:
        write_text("late", folder / "two")
    finally:
        print("it began", flush=True)
with whole_file(folder / "one") as beside:
    beside.write_text("half")
    remove_unfinished()
    thread = threading.Thread(target=late, daemon=True)
    thread.start()
    thread.join(0.2)
    import os
    os._exit(0)
"""
    done = subprocess.run([sys.executable, "-c", script, tmp_path], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("one", "old")]
