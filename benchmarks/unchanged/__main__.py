"""Record the corpus with one environment, or compare two recordings."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from benchmarks.unchanged.compare import compare
from benchmarks.unchanged.record import record


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.unchanged", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    recording = commands.add_parser("record", help="run the corpus, and keep what came of it")
    recording.add_argument("folder", type=Path, help="a new folder")
    beside = Path(sys.executable)
    recording.add_argument("--posekit", type=Path, default=beside.with_name("posekit"), help="the command")
    recording.add_argument("--python", type=Path, default=beside, help="the interpreter")
    recording.add_argument(
        "--pythonpath", type=Path, help="a checkout to take posekit from, with that interpreter"
    )
    recording.add_argument("--data", type=Path, help="the folder of real recordings")
    recording.add_argument("--only", default="*", help="a glob of cases")
    recording.add_argument("--jobs", type=int, default=1, help="cases at a time")
    comparing = commands.add_parser("compare", help="exit 1 where a difference is not expected")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    comparing.add_argument("-o", "--output", type=Path, help="the report, Markdown")
    given = parser.parse_args(arguments)
    if given.command == "compare":
        return compare(given.before, given.after, given.output)
    if given.folder.exists():
        parser.error(f"{given.folder} is there already; choose a new folder")
    record(
        given.folder,
        posekit=given.posekit,
        python=given.python,
        pythonpath=given.pythonpath,
        data=given.data,
        only=given.only,
        jobs=given.jobs,
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
