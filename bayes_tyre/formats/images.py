"""Image files of a user, recognised by their content: their names may say anything."""

from io import BytesIO
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

from bayes_tyre.errors import BadInput

#: Bytes of an image that goes into a page: a logo has some thousand.
MOST_BYTES = 1 << 20
#: Media types by the first bytes of their files.
_SIGNATURES = {
    b"\x89PNG\r\n\x1a\n": "image/png",
    b"\xff\xd8\xff": "image/jpeg",
    b"GIF87a": "image/gif",
    b"GIF89a": "image/gif",
}
_SVG = "{http://www.w3.org/2000/svg}svg"


class Image(NamedTuple):
    """An image as its file holds it, and its media type, such as ``image/png``."""

    media_type: str
    content: bytes


def read_image(path: Path, option: str) -> Image:
    """Return a PNG, JPEG, GIF, WebP or SVG image of at most `MOST_BYTES` that an option names.

    Raises
    ------
    BadInput
        If the file cannot be read, is too large, or is no such image.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise BadInput(f"{option} {path}: cannot be read ({error.strerror}); name an image file") from None
    if len(content) > MOST_BYTES:
        raise BadInput(f"{option} {path}: is larger than {MOST_BYTES >> 20} MiB; give a smaller image")
    media_type = _media_type(content)
    if media_type is None:
        raise BadInput(f"{option} {path}: is no image that a page can show; give PNG, JPEG, GIF, WebP or SVG")
    return Image(media_type, content)


def _media_type(content: bytes) -> str | None:
    kind_of_content = next((kind for first, kind in _SIGNATURES.items() if content.startswith(first)), None)
    if kind_of_content is None and content[:4] == b"RIFF" and content[8:12] == b"WEBP":
        return "image/webp"
    return kind_of_content or ("image/svg+xml" if _is_svg(content) else None)


def _is_svg(content: bytes) -> bool:
    """Return whether the root of an XML document is `svg`; what follows the root's tag is not looked at."""
    try:
        # A document type may declare entities that grow without bound where they are used: none is before the root.
        _, root = next(ElementTree.iterparse(BytesIO(content), ["start"]))
    except (ElementTree.ParseError, StopIteration):
        return False
    return root.tag == _SVG
