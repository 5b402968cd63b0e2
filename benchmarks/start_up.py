"""Start-up time of commands relative to `import pinocchio, numpy`, and modules and files that `inspect` loads.

    python -m benchmarks.start_up [--runs 5] [--only NAME]

Processes run in turns, so that other work on the machine affects all of them alike. Ratios are of the least wall time
and of the least processor time.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import posekit
from benchmarks.common import parser, sampled, table

BASE = "import pinocchio, numpy"
WATCHED = """
import sys
opened = []
sys.addaudithook(lambda event, given: opened.append(str(given[0])) if event == "open" else None)
sys.argv = ["posekit", "inspect", {path!r}]
from posekit.__main__ import main
try:
    main()
except SystemExit:
    pass
own = sorted(name for name in sys.modules if name.split(".")[0] == "posekit")
print("modules", len(own), "opens", sum(one == {path!r} for one in opened))
"""


def environment() -> dict[str, str]:
    """Return the environment variables of a process that runs this posekit."""
    root = str(Path(posekit.__file__).parents[1])
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {**kept, "PYTHONPATH": os.pathsep.join([root, os.environ.get("PYTHONPATH", "")])}


def spend(arguments: list[str], folder: Path) -> tuple[float, float]:
    """Run Python once; return wall time and processor time, seconds."""
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    done = subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment(), capture_output=True, check=False
    )
    clock, after = time.perf_counter() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in (0, 1):  # 1: validate found something
        sys.exit(f"{arguments}: exit {done.returncode}: {done.stderr.decode()[-500:]}")
    return clock, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    made = parser(__doc__)
    made.add_argument("--runs", type=int, default=5)
    made.add_argument("--only", default="", help="part of the names of the processes")
    given = made.parse_args()
    with sampled() as folder:
        command = ["-m", "posekit"]
        ways = {
            BASE: ["-c", BASE],
            "import posekit": ["-c", "import posekit"],
            "posekit --help": [*command, "--help"],
            "posekit inspect jump.bvh": [*command, "inspect", "jump.bvh"],
            "posekit validate jump.bvh": [*command, "validate", "jump.bvh"],
            "posekit recover, one exact frame": [*command, "recover", "one.json", "-o", "result.npz"],
        }
        spend([*command, "synth", "walker", "-o", "one.json", "--frames", "1"], folder)
        ways = {name: one for name, one in ways.items() if name == BASE or given.only in name}
        for arguments in ways.values():
            spend(arguments, folder)
        spent: dict[str, list[tuple[float, float]]] = {name: [] for name in ways}
        for _ in range(given.runs):
            for name, arguments in ways.items():
                spent[name].append(spend(arguments, folder))
        least = {name: [min(turn[k] for turn in turns) for k in (0, 1)] for name, turns in spent.items()}
        rows = [
            (
                name,
                *(f"{one:.2f}" for one in both),
                *(f"{a / b:.2f}" for a, b in zip(both, least[BASE], strict=True)),
            )
            for name, both in least.items()
        ]
        print(table(("process", "wall, s", "processor, s", "wall ratio", "processor ratio"), rows))
        code = WATCHED.format(path="jump.bvh")
        done = subprocess.run(
            [sys.executable, "-c", code],
            cwd=folder,
            env=environment(),
            capture_output=True,
            text=True,
            check=True,
        )
        print(f"posekit inspect jump.bvh: {done.stdout.splitlines()[-1]}")


if __name__ == "__main__":
    main()
