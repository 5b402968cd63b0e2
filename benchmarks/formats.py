"""Results that are written and read again, and files that are opened: seconds, bytes, and differences.

    python -m benchmarks.formats [--frames 1000] [--data DIR]

A result of random exact views is written as JSON, NPZ and Parquet, read, and judged again; verdicts must be equal. With
`--data` every file below the folders is opened, and files are counted by recognised content, or as refused.
"""

from __future__ import annotations

import pickle
import tempfile
from collections import Counter
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import posekit
from benchmarks.common import data_of, files_below, least, parser, table
from benchmarks.solver import noisy_view
from posekit.errors import PosekitError
from posekit.recovery import Recovery

ENDINGS = ("json", "npz", "parquet")
NOT_DATA = (".md", ".txt", "", ".rst", ".py")


def round_trips(result: Recovery, folder: Path) -> list[tuple[str, ...]]:
    """Write and read a result in every container, and as a pickle for comparison."""
    rows: list[tuple[str, ...]] = []
    paths = {ending: folder / f"result.{ending}" for ending in ENDINGS}
    spare, arrays = folder / "result.pickle", (result.survivors.joints, result.survivors.q)
    ways: dict[str, Callable[[], object]] = {
        **{f"{ending} write": partial(posekit.save, result, path) for ending, path in paths.items()},
        "pickle write": lambda: spare.write_bytes(pickle.dumps(arrays)),
        **{f"{ending} read": partial(posekit.open, path) for ending, path in paths.items()},
        "pickle read": lambda: pickle.loads(spare.read_bytes()),
    }
    spent = least(ways, 3)
    for ending in (*ENDINGS, "pickle"):
        size = (folder / f"result.{ending}").stat().st_size
        seconds = (spent[f"{ending} {way}"] for way in ("write", "read"))
        rows.append((ending, *(f"{one:.3f}" for one in seconds), f"{size / 1e6:.1f}"))
    return rows


def verdicts(result: Recovery, folder: Path) -> dict[str, NDArray[np.bool_]]:
    """Judge the survivors of a result from memory and from each file."""
    found = {"memory": posekit.validate(result).ok}
    return found | {ending: posekit.validate(folder / f"result.{ending}").ok for ending in ENDINGS}


def opened(paths: list[Path]) -> list[tuple[str, str, int]]:
    """Count the files of each suffix by recognised content."""
    counts: Counter[tuple[str, str]] = Counter()
    for file in files_below(paths):
        if file.suffix not in NOT_DATA:
            try:
                kind = type(posekit.open(file)).__name__
            except PosekitError as error:
                kind = "refused"
                print(f"{file}: {error}")
            counts[file.suffix, kind] += 1
    return [(ending, kind, count) for (ending, kind), count in sorted(counts.items())]


def main() -> None:
    made = parser(__doc__)
    made.add_argument("--frames", type=int, default=1000)
    given = made.parse_args()
    with tempfile.TemporaryDirectory() as spare:
        folder = Path(spare)
        result = posekit.recover(noisy_view(given.frames, 0.0, given.seed))
        print(f"a result of {len(result)} frames, {len(result.survivors)} survivors")
        print(table(("container", "write, s", "read, s", "MB"), round_trips(result, folder)))
        judged = verdicts(result, folder)
        valid = {name: f"{int(ok.sum())} of {len(ok)}" for name, ok in judged.items()}
        print(f"valid when judged again: {valid}")
    if data_of(given):
        print(table(("ending", "opened as", "files"), opened(data_of(given))))


if __name__ == "__main__":
    main()
