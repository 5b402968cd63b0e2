"""Table 1 of Lee & Chen 1985 on motion of people: its angles as printed, and as rotations from standing.

    python benchmarks/table1.py FILE [FILE ...]

Files are what `benchmarks/people.py` reads. The true joints of every complete frame are judged, within a thousandth of
a degree. Prints Markdown tables: what is accepted by action, and which rows of the table reject how many frames.
"""

from __future__ import annotations

import argparse
from collections import Counter

import numpy as np
from people import people  # type: ignore[import-not-found]  # the scripts beside this one
from ranges import Clip, clips_of  # type: ignore[import-not-found]

from posekit.formats.markdown import table_lines
from posekit.validators import load_ranges

TABLES = ("table1-printed", "table1")


def told(clips: list[Clip]) -> None:
    """Print what both tables accept of some clips, and why they reject the rest."""
    accepted: dict[tuple[str, str], list[np.ndarray]] = {}
    reasons: dict[str, Counter[str]] = {name: Counter() for name in TABLES}
    for clip in clips:
        for name in TABLES:
            bad, places = clip.rejected(load_ranges(name))
            for action in ("all", clip.action):
                accepted.setdefault((action, name), []).append(~bad)
            either: dict[str, np.ndarray] = {}
            for where, each in places.items():
                row = where.removeprefix("right_").removeprefix("left_")
                either[row] = either.get(row, False) | each
            reasons[name].update({row: int(each.sum()) for row, each in either.items()})
    rows = []
    for action in dict.fromkeys(action for action, _ in accepted):
        kept = [np.concatenate(accepted[action, name]) for name in TABLES]
        rows.append([action, str(len(kept[0])), *(f"{each.mean():.1%}" for each in kept)])
    print("\n".join(table_lines(["action", "frames", *TABLES], rows)) + "\n")
    rejecting = dict.fromkeys(row for name in TABLES for row, count in reasons[name].most_common() if count)
    rows = [[row, *(str(reasons[name][row]) for name in TABLES)] for row in rejecting]
    print("\n".join(table_lines(["row", *TABLES], rows)) + "\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+")
    for file in parser.parse_args().files:
        capture = people(file)
        print(f"{len(capture.points)} frames, {len(capture.names)} clips\n")
        told(clips_of(capture))


if __name__ == "__main__":
    main()
