"""Attack for some minutes, keep what is found, and print the counts."""

from __future__ import annotations

import argparse
import importlib
import json
import pkgutil
import random
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import posekit
from benchmarks.fuzz.cases import (
    OPTION_COMMANDS,
    Case,
    file_case,
    kill_case,
    option_case,
    write_seeds,
)
from benchmarks.fuzz.damage import damaged
from benchmarks.fuzz.structure import rearranged
from benchmarks.fuzz.trial import Outcome, in_fork, placed, tried
from posekit.formats.markdown import table_lines
from posekit.safe_io import write_lines

WHOLE_SECONDS = 600
OPTION_SHARE, KILL_SHARE = 0.25, 0.05
"""The shares of cases that are odd options, and whole commands that are killed; the others are damaged files."""


COUNTED_EVERY = 100
"""Cases after which the counts are written, beside what was found."""


def changed(data: bytes, rng: random.Random) -> bytes:
    """Damage the bytes of a file, or what it says."""
    said = rearranged(data, rng) if rng.random() < 0.4 else None
    return damaged(data, rng) if said is None else said


def drawn(seeds: dict[str, list[Path]], folder: Path, rng: random.Random) -> Case:
    """Draw a case."""
    share = rng.random()
    if share < OPTION_SHARE:
        return option_case(rng)
    return kill_case(rng) if share < OPTION_SHARE + KILL_SHARE else file_case(seeds, folder, rng, changed)


def keep(folder: Path, number: int, case: Case, outcome: Outcome) -> None:
    """Keep a case that is not clean: its file, and what came of it."""
    folder.mkdir(parents=True, exist_ok=True)
    if case.name:
        (folder / f"{number}.{Path(case.name).name}").write_bytes(case.data)
    said = {
        "kind": case.kind,
        "arguments": case.arguments,
        "name": case.name,
        "what": outcome.what,
        "detail": outcome.detail,
    }
    (folder / f"{number}.case.json").write_text(json.dumps(said, indent=1), encoding="utf-8")


def counted(counts: Counter[tuple[str, str]]) -> list[str]:
    """Return a table of outcomes by kind."""
    whats = sorted({what for _, what in counts})
    kinds = sorted({kind for kind, _ in counts})
    rows = [(kind, *(counts[kind, what] for what in whats)) for kind in kinds]
    return table_lines(("kind", *whats), [*rows, ("all", *(sum(counts[k, w] for k in kinds) for w in whats))])


def main() -> int:
    """Attack."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.fuzz", description=__doc__)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "-o", "--output", type=Path, default=Path("fuzz-results"), help="where finds are kept"
    )
    given = parser.parse_args()
    for module in pkgutil.walk_packages(posekit.__path__, "posekit."):
        importlib.import_module(module.name)
    counts: Counter[tuple[str, str]] = Counter()
    with tempfile.TemporaryDirectory() as made:
        seeds_folder, folder = Path(made) / "seeds", Path(made) / "case"
        seeds_folder.mkdir()
        said = Path(made) / "said"

        def run(arguments: list[str]) -> int:
            """Run a whole command: loops are compiled in none of the cases."""
            return in_fork(arguments, said, WHOLE_SECONDS, processor=WHOLE_SECONDS) or 0

        seeds = write_seeds(seeds_folder, run)
        folder.mkdir()
        for command in OPTION_COMMANDS:
            run(placed(command.split(), folder, folder / "out", seeds_folder))
        ends, number = time.monotonic() + 60 * given.minutes, 0
        while time.monotonic() < ends:
            rng = random.Random(f"{given.seed}.{number}")
            case = drawn(seeds, seeds_folder, rng)
            outcome = tried(case, seeds_folder, folder)
            counts[case.kind, outcome.what] += 1
            if not outcome.clean:
                keep(given.output, number, case, outcome)
                print(f"{number}: {outcome.what}: {' '.join(case.arguments)}", file=sys.stderr, flush=True)
            number += 1
            if number % COUNTED_EVERY == 0:
                given.output.mkdir(parents=True, exist_ok=True)
                write_lines(given.output / "counts.md", counted(counts))
    print(*counted(counts), sep="\n")
    return int(any(not Outcome(what).clean for _, what in counts))


if __name__ == "__main__":
    sys.exit(main())
