"""What a lab writes above its report: title, order, operator and logo."""

from typing import NamedTuple

from bayes_tyre.report.answer.formatting import label

#: The most letters of a title, an order and an operator.
LONGEST = 200


class Letterhead(NamedTuple):
    """What stands above a report; empty: the report's own title, and nothing.

    Attributes
    ----------
    title, order, operator:
        Text, never markup.
    logo:
        An image as a ``data:`` URI.
    """

    title: str = ""
    order: str = ""
    operator: str = ""
    logo: str = ""

    @property
    def lines(self) -> list[tuple[str, str]]:
        """What stands below the title: a word and a text each."""
        named = (("Order", self.order), ("Operator", self.operator))
        return [(name, text) for name, value in named if (text := label(value, LONGEST))]

    def titled(self, title: str) -> str:
        """Return the title; `title` where none is given."""
        return label(self.title, LONGEST) or title


NONE = Letterhead()
