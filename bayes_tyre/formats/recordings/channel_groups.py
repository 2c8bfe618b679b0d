"""Groups of channels, each with times of its own, as the segments of a recording."""

from collections.abc import Iterable, Sequence

from bayes_tyre.record import Channel


def segments_of(groups: Iterable[Sequence[Channel]]) -> tuple[tuple[Channel, ...], ...]:
    """Return groups as segments: a group is of the same recording as the one before unless it repeats a name.

    Recorders write a group for each sampling rate or device; a name that is there twice is of another recording, or of
    the same at another rate.
    """
    segments: list[list[Channel]] = []
    for group in filter(None, groups):
        if segments and not {one.name for one in segments[-1]} & {one.name for one in group}:
            segments[-1].extend(group)
        else:
            segments.append(list(group))
    return tuple(map(tuple, segments))
