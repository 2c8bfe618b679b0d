"""Commands disturbed at random moments: afterwards the bytes of a run left alone.

As a program (`make chaos`) it goes on for as many seconds as it is told: ``python -m helpers.chaos 600``. Further
arguments are the seed, and how many fits run at once on one compilation cache first.
"""

import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np
from helpers.disturbed import (
    COMMANDS,
    assert_as_left_alone,
    at_once,
    clock_set_back,
    input_changed,
    inputs,
    killed,
    left_alone,
    out_of_disk,
)


def chaos(
    folder: Path, names: tuple[str, ...], until: Callable[[int], bool], seed: int, say: Callable[[str], None] = print
) -> Counter[str]:
    """Disturb commands at random moments until told to stop; return how often each was.

    Each comes once, then the quick ones more often.

    Parameters
    ----------
    folder, names:
        What `inputs` made, and which of `COMMANDS`.
    until:
        Called with the number of disturbances so far; True: enough.
    seed, say:
        Of the moments; called with each disturbance before it is made.
    """
    rng, counts = np.random.default_rng(seed), Counter[str]()
    alone = {name: left_alone(COMMANDS[name], folder) for name in names}
    often = np.array([alone[name].seconds ** -0.5 for name in names])
    while not until(counts.total()):
        name = names[counts.total()] if counts.total() < len(names) else str(rng.choice(names, p=often / often.sum()))
        command, seconds = COMMANDS[name], alone[name].seconds
        if rng.random() < 0.3:
            most = int(10 ** rng.uniform(2, 6))
            say(f"{name}: no file above {most} bytes")
            out_of_disk(command, folder, most, alone[name])
        else:
            after_s = rng.uniform(0.3, 1.0) * seconds
            say(f"{name}: killed after {after_s:.2f} s of {seconds:.2f} s")
            killed(command, folder, after_s)
        if command.resumes and (folder / command.line[1]).exists() and rng.random() < 0.2:
            say(f"{name}: another input")
            input_changed(command, folder)
        if rng.random() < 0.3:
            say(f"{name}: the clock is set back")
            clock_set_back(folder)
        assert_as_left_alone(command, folder, alone[name].files)
        counts[name] += 1
    return counts


def alike(folder: Path, name: str, runs: int) -> None:
    """Assert that a command gives the bytes of a run left alone, run so often at once on one compilation cache."""
    alone = left_alone(COMMANDS[name], folder).files
    for number, result in enumerate(at_once(COMMANDS[name], folder, runs)):
        assert result == alone, f"run {number} of {runs} at once differs"
    print(f"{runs} runs of {name} at once on one compilation cache: the same bytes", flush=True)


def main() -> None:
    """Disturb all commands for as many seconds as the command line says, and print how often."""
    seconds, seed, runs = (*map(int, sys.argv[1:]), *(600, 0, 10)[len(sys.argv) - 1 :])
    with tempfile.TemporaryDirectory() as place:
        folder = inputs(Path(place))
        alike(folder, "fit", runs)
        moments: list[float] = []

        def enough(_: int) -> bool:
            moments.append(time.monotonic())  # from the first disturbance on: the runs left alone may take an hour
            return moments[-1] - moments[0] > seconds

        counts = chaos(folder, tuple(COMMANDS), enough, seed)
    took = moments[-1] - moments[0]
    assert counts.total(), "nothing was disturbed: the time was too short"
    print(f"{counts.total()} disturbances in {took:.0f} s, each with the bytes of a run left alone: {dict(counts)}")


if __name__ == "__main__":
    main()
