"""Play machines that are not like the developers': what posekit does on each, in one line a command.

    python benchmarks/machines.py

Prints what docs/install.md sums up. Each machine is made of this one: what it lacks is taken from the commands'
environment. Its likeliest postures are held against those of this machine as it is. What only root can take away
(512 MB of memory, a home that takes nothing) is left out for others, and said.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

POSEKIT_COMMAND: Final = str(Path(sys.executable).parent / "posekit")
COMMANDS_TRIED: Final = (
    "samples samples",
    "recover samples/walk.json -o postures.npz",
    "validate samples/walk.npz",
    "recover samples/keypoints --camera samples/calibration.toml -o recording.npz",
    "convert recording.npz walk.bvh",
    "render postures.npz --view samples/walk.json -o postures.html",
    "render postures.npz --view samples/walk.json -o postures.png",
)
"""The tutorials' ways, one after the other in a folder of their own."""
MEMORY_MEGABYTES: Final = 512
AVX512_FEATURES: Final = "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL"


class Machine(NamedTuple):
    """What is other than here: words before the command, and variables."""

    name: str
    before: tuple[str, ...] = ()
    variables: tuple[tuple[str, str], ...] = ()


def machines(scratch: Path) -> Iterator[Machine]:
    """Yield the machines that can be had, this one first."""
    yield Machine("as it is")
    yield Machine("no browser", variables=(("PATH", str(scratch / "empty")),))
    yield Machine(
        "no AVX-512",
        variables=(
            ("NPY_DISABLE_CPU_FEATURES", AVX512_FEATURES),
            ("NUMBA_CPU_NAME", "generic"),
            ("OPENBLAS_CORETYPE", "Haswell"),
        ),
    )
    yield Machine("one core", before=("taskset", "--cpu-list", "0"))
    ascii_only = (("LC_ALL", "POSIX"), ("PYTHONUTF8", "0"), ("PYTHONCOERCECLOCALE", "0"))
    yield Machine("ASCII, Chatham Islands", variables=(*ascii_only, ("TZ", "Pacific/Chatham")))
    if os.getuid() != 0:
        print("not root: 512 MB and a home that takes nothing are left out", file=sys.stderr)
        return
    mounted = f'mount -t tmpfs -o ro none {scratch / "home"} && exec "$@"'
    home = (("HOME", str(scratch / "home")), ("XDG_CACHE_HOME", ""), ("XDG_CONFIG_HOME", ""))
    yield Machine("read-only home", ("unshare", "--mount", "sh", "-c", mounted, "sh"), home)
    group = Path("/sys/fs/cgroup/memory/posekit")
    limit = group / "memory.limit_in_bytes"
    if not group.parent.is_dir():
        group = Path("/sys/fs/cgroup/posekit")
        limit = group / "memory.max"
    group.mkdir(exist_ok=True)
    limit.write_text(str(MEMORY_MEGABYTES << 20), encoding="ascii")
    joined = f'echo $$ > {group}/cgroup.procs && exec "$@"'
    yield Machine(f"{MEMORY_MEGABYTES} MB", ("sh", "-c", joined, "sh"))


def tried(machine: Machine, scratch: Path) -> tuple[list[str], Path]:
    """Run the commands on a machine, and return what came out in words, and their folder."""
    folder = Path(tempfile.mkdtemp(dir=scratch))
    environment = {**os.environ, **dict(machine.variables)}
    found = []
    for command in COMMANDS_TRIED:
        done = subprocess.run(
            [*machine.before, POSEKIT_COMMAND, *command.split()],
            cwd=folder,
            env=environment,
            check=False,
            capture_output=True,
            text=True,
            errors="replace",
        )
        last = (done.stderr.strip().splitlines() or [""])[-1]
        if done.returncode != 0 or "Traceback" in done.stderr:
            found.append(f"`{command.split()[-1]}`: exit {done.returncode}, {last[:60]}")
    return found, folder


def joints(folder: Path, name: str) -> np.ndarray | None:
    """Return the likeliest joints of each frame of a result, or None where there is none."""
    if not (folder / name).exists():
        return None
    with np.load(folder / name) as held:
        listed = np.asarray(held["joints"])
        if "probability" not in held:
            return listed
        first = np.argmax(np.nan_to_num(held["probability"]), axis=1)
        return np.asarray(listed[np.arange(len(listed)), first])


def main() -> None:
    """Print the table."""
    print(
        "| machine | commands that work | likeliest joints beside the first row | what is said of the others |"
    )
    print("|---|---|---|---|")
    with tempfile.TemporaryDirectory() as kept:
        scratch = Path(kept)
        (scratch / "empty").mkdir()
        (scratch / "home").mkdir()
        first: dict[str, np.ndarray | None] = {}
        for machine in machines(scratch):
            found, folder = tried(machine, scratch)
            differences = []
            for name in ("postures.npz", "recording.npz"):
                here = joints(folder, name)
                there = first.setdefault(name, here)
                if here is None or there is None or here.shape != there.shape:
                    differences.append("other postures")
                else:
                    differences.append(f"{np.nanmax(np.abs(here - there), initial=0.0):.0e} m")
            worked = f"{len(COMMANDS_TRIED) - len(found)} of {len(COMMANDS_TRIED)}"
            print(f"| {machine.name} | {worked} | {', '.join(differences)} | {'; '.join(found) or '-'} |")


if __name__ == "__main__":
    main()
