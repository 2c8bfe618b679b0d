"""Check that every internal link of a built site resolves, and that no page loads anything from a network.

`python docs/check_links.py results/docs/html` works offline: external links are not followed.
"""

import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

#: What a page loads, by tag and attribute; an `a` is only followed by a reader.
LOADED = {"script": "src", "link": "href", "img": "src", "source": "src", "iframe": "src"}
#: Relations of a `link` that load nothing.
NAMED_ONLY = {"canonical", "author", "next", "prev", "index", "search", "genindex"}


class Page(HTMLParser):
    """The anchors of a page, what it links to, and what it loads."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: set[str] = set()
        self.loaded: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Collect the anchors, links and loaded files of one tag."""
        attributes = {name: value or "" for name, value in attrs}
        self.anchors |= {attributes[name] for name in ("id", "name") if name in attributes}
        if tag == "a" and "href" in attributes:
            self.links.add(attributes["href"])
        target = attributes.get(LOADED.get(tag, ""))
        if target and not (tag == "link" and set(attributes.get("rel", "").split()) & NAMED_ONLY):
            self.loaded.add(target)


def faults(site: Path) -> list[str]:
    """Return one line for each dead link, and one for each file that a page would fetch from a network."""
    pages = {path.resolve(): Page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}
    dead_links = []
    for path, page in pages.items():
        name = path.relative_to(site.resolve())
        for link in sorted(page.links | page.loaded):
            parts = urlsplit(link)
            if parts.scheme == "data":
                continue
            if parts.scheme or parts.netloc:
                if link in page.loaded:
                    dead_links.append(f"{name}: loads {link} from a network")
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            anchor = unquote(parts.fragment)
            if not target.exists():
                dead_links.append(f"{name}: {link} leads nowhere")
            elif anchor and target in pages and anchor not in pages[target].anchors:
                dead_links.append(f"{name}: {link} leads to a page that has no such place")
    for sheet in sorted(site.rglob("*.css")):
        text = sheet.read_text(encoding="utf-8").replace("'", "").replace('"', "")
        if any(loads in text for loads in ("url(http", "url(//", "@import http")):
            dead_links.append(f"{sheet.relative_to(site)}: loads from a network")
    return dead_links


def main() -> int:
    """Print the faults of the site named; return 1 if there are any."""
    site = Path(sys.argv[1])
    if not (site / "index.html").is_file():
        print(f"{site}: holds no index.html; build the site first")
        return 2
    dead_links = faults(site)
    for line in dead_links:
        print(line)
    print(f"{sum(1 for _ in site.rglob('*.html'))} pages, {len(dead_links)} dead links")
    return 1 if dead_links else 0


if __name__ == "__main__":
    sys.exit(main())
