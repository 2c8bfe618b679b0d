"""Images by their content: which are taken, and what is refused."""

import pytest

from bayes_tyre.errors import BadInput
from bayes_tyre.formats.images import MOST_BYTES, read_image

SVG = '<svg xmlns="http://www.w3.org/2000/svg"><rect width="1" height="1"/></svg>'


@pytest.mark.parametrize(
    ("content", "media_type"),
    [
        (b"\x89PNG\r\n\x1a\n...", "image/png"),
        (b"\xff\xd8\xff\xe0 JFIF", "image/jpeg"),
        (b"GIF89a...", "image/gif"),
        (b"RIFF....WEBPVP8 ", "image/webp"),
        (SVG.encode(), "image/svg+xml"),
        (f'<?xml version="1.0"?><!DOCTYPE svg><!-- a logo -->{SVG}'.encode("utf-16"), "image/svg+xml"),
    ],
)
def test_an_image_is_known_by_its_content_whatever_its_name(content, media_type, tmp_path):
    path = tmp_path / "logo.txt"
    path.write_bytes(content)
    assert read_image(path, "--logo") == (media_type, content)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"%PDF-1.7",
        b"record,k\n",
        b"RIFF....WAVE",
        b"<html><svg/></html>",
        SVG.replace("svg", "sgv", 1).encode(),
        b"<svg",
    ],
)
def test_what_is_no_image_is_refused(content, tmp_path):
    path = tmp_path / "logo.png"
    path.write_bytes(content)
    with pytest.raises(BadInput, match=r"--logo .*logo.png: is no image that a page can show; give PNG, JPEG"):
        read_image(path, "--logo")


def test_what_is_too_large_or_not_there_is_refused(tmp_path):
    path = tmp_path / "logo.png"
    with pytest.raises(BadInput, match="cannot be read"):
        read_image(path, "--logo")
    path.write_bytes(b"\x89PNG\r\n\x1a\n".ljust(MOST_BYTES + 1))
    with pytest.raises(BadInput, match="is larger than 1 MiB; give a smaller image"):
        read_image(path, "--logo")
    path.write_bytes(b"\x89PNG\r\n\x1a\n".ljust(MOST_BYTES))
    assert len(read_image(path, "--logo").content) == MOST_BYTES
