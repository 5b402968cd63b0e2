"""Play the newcomer: from a clone to the first picture, and to the result of each tutorial, in a fresh environment.

    python benchmarks/newcomer.py [--keep DIR]

Everything that is typed is read from the blocks of README and docs: the clone's `make demo`, then each tutorial's
commands in a folder of its own, with the environment that `make demo` made. pip keeps no cache: all packages are
fetched. Prints what docs/install.md sums up: commands, seconds by the clock, and what there is to look at.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

ROOT: Final = Path(__file__).resolve().parents[1]
MAY_FAIL: Final = "posekit validate "
"""A command that ends with 1 where it finds something."""
LOOKED_AT: Final = (".html", ".png", ".bvh", ".csv", ".json")
"""Endings of what a newcomer opens, the first that is there."""


class Journey(NamedTuple):
    """What is typed where, and a name for it."""

    name: str
    commands: list[str]
    folder: Path


def typed(page: Path, heading: str = "") -> Iterator[str]:
    """Yield the commands of a page's shell blocks, below a heading or all."""
    text = (
        page.read_text(encoding="utf-8").partition(heading)[2]
        if heading
        else page.read_text(encoding="utf-8")
    )
    for block in re.findall(r"^```sh\n(.*?)^```$", text, re.M | re.S):
        for line in block.splitlines():
            command = re.sub(r"\s+#\s.*$", "", line).strip()
            if command:
                yield command


def journeys(clone: Path) -> Iterator[Journey]:
    """Yield the README's way to the first picture, and each tutorial's."""
    demo = next(
        command for command in typed(clone / "README.md", "## Two commands") if command == "make demo"
    )
    yield Journey("README: first picture", [demo], clone)
    for page in sorted((clone / "docs/tutorials").glob("*.md")):
        folder = clone.parent / page.stem
        folder.mkdir()
        yield Journey(f"tutorial: {page.stem}", list(typed(page)), folder)


def travel(journey: Journey, clone: Path) -> str:
    """Run a journey's commands, and return its row of the table."""
    path = f"{clone / '.venv/bin'}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "PIP_NO_CACHE_DIR": "1", "PIP_NO_INPUT": "1"}
    environment.pop("PYTHONPATH", None)
    before = set(journey.folder.rglob("*"))
    start = time.perf_counter()
    for command in journey.commands:
        done = subprocess.run(
            command, shell=True, cwd=journey.folder, env=environment, check=False, text=True
        )
        if done.returncode not in ((0, 1) if command.startswith(MAY_FAIL) else (0,)):
            sys.exit(f"{journey.name}: {command}: exit {done.returncode}")
    seconds = time.perf_counter() - start
    made = [path for path in journey.folder.rglob("*") if path not in before and ".venv" not in path.parts]
    own = [path for path in made if "samples" not in path.parts]
    seen = next((p.name for suffix in LOOKED_AT for p in sorted(own) if p.suffix == suffix), "nothing")
    return f"| {journey.name} | {len(journey.commands)} | {seconds:.0f} | `{seen}` |"


def main() -> None:
    """Clone, travel, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--keep", type=Path, help="a folder to work in, which stays")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as spare:
        folder = (given.keep or Path(spare)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        clone = folder / "posekit"
        subprocess.run(["git", "clone", "--quiet", ROOT, clone], check=True)
        rows = [travel(journey, clone) for journey in journeys(clone)]
    print("\n| way | commands | seconds | to look at |\n|---|---|---|---|", *rows, sep="\n")


if __name__ == "__main__":
    main()
