"""From a clone to the first picture, and to a result of one's own data for each of three jobs, in a new environment.

    python -m benchmarks.newcomer [--here] [--folder DIR] [--only JOB]

The three jobs validate an array of postures, validate configurations of a robot, and recover postures from a detector's
key points. Each step is a command of README, in the environment that `make demo` created. pip uses no cache, so all
packages are downloaded. `--here` skips the clone and runs the jobs with this Python. Prints wall-clock seconds.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import posekit
from benchmarks.common import parser, table, walk
from benchmarks.start_up import environment
from posekit.synthesis import default_camera, look_at, to_camera

ROOT = Path(__file__).resolve().parents[1]
JUDGE_ARRAY = """
import numpy as np, posekit
report = posekit.validate(np.load("mine.npy"), rate=30)
print(report.decision)
report.save("mine.html")
"""
JUDGE_ROBOT = """
import numpy as np, posekit
g1 = posekit.Validator("g1")
q = np.tile(g1.robot.neutral, (100, 1))
q[:, -1] += np.linspace(0, 3, 100)
report = g1.check(q)
print(int(report.ok.sum()), report.worst.min())
"""
JOBS = {
    "an array of one's own": [["-c", JUDGE_ARRAY]],
    "configurations of a robot": [["-c", JUDGE_ROBOT]],
    "key points of a detector": [
        ["-m", "posekit", "recover", "mine.json", "-o", "mine.npz", "--stature", "175cm", "--rate", "30"],
        ["-m", "posekit", "render", "mine.npz", "-o", "key points.html"],
    ],
}


def write_own(folder: Path) -> None:
    """Write a newcomer's data: joints of a walk as an array, and COCO key points of the walk from the side."""
    joints = walk(0.8, 60).figure_joints
    np.save(folder / "mine.npy", joints)
    centre = joints.mean(axis=(0, 1)) + np.array([0.0, 0.2, 5.0])
    R = look_at(centre, joints.mean(axis=(0, 1)), np.array([0.0, 1.0, 0.0]))
    seen = default_camera().project(to_camera(joints, R, centre))[::6]
    order = {5: 2, 6: 1, 7: 7, 8: 6, 9: 9, 10: 8, 11: 5, 12: 4, 13: 11, 14: 10, 15: 13, 16: 12}
    frames = []
    for k, frame in enumerate(seen):
        points = np.zeros((17, 3))
        for coco, own in order.items():
            points[coco] = [*frame[own], 0.9]
        frames.append({"image_id": k, "category_id": 1, "keypoints": points.ravel().tolist(), "score": 0.9})
    (folder / "mine.json").write_text(json.dumps(frames))


def run(arguments: list[str], folder: Path, env: dict[str, str]) -> tuple[float, str]:
    """Run a command; return seconds and the last line that it printed, or its error."""
    start = time.perf_counter()
    done = subprocess.run(arguments, cwd=folder, env=env, capture_output=True, text=True, check=False)
    said = (done.stdout if done.returncode in (0, 1) else done.stderr).strip().splitlines()
    failed = "" if done.returncode in (0, 1) else f"exit {done.returncode}: "
    return time.perf_counter() - start, failed + (said[-1] if said else "")


def main() -> None:
    made = parser(__doc__)
    made.add_argument("--here", action="store_true")
    made.add_argument("--folder", type=Path, help="folder to work in, which stays")
    made.add_argument("--only", default="", help="part of the names of the jobs")
    given = made.parse_args()
    rows = []
    with tempfile.TemporaryDirectory() as spare:
        folder = (given.folder or Path(spare)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        python, env = sys.executable, environment()
        if not given.here:
            clone = folder / "posekit"
            env = {**os.environ, "PIP_NO_CACHE_DIR": "1", "PIP_NO_INPUT": "1"}
            env.pop("PYTHONPATH", None)
            rows.append(("clone", *run(["git", "clone", "--quiet", str(ROOT), str(clone)], folder, env)))
            start = time.time()
            seconds, said = run(["make", "demo"], clone, env)
            first = (clone / "demo-results" / "jump.png").stat().st_mtime - start
            rows.append(("make demo: first picture", first, "jump.png"))
            rows.append(("make demo: the rest, most of it the papers' rows", seconds - first, said))
            python = str(clone / ".venv/bin/python")
        write_own(folder)
        for name, steps in ((name, steps) for name, steps in JOBS.items() if given.only in name):
            done = [run([python, *step], folder, env) for step in steps]
            rows.append((name, sum(seconds for seconds, _ in done), done[-1][1]))
    print(table(("step", "s", "said"), [(name, f"{seconds:.1f}", said[:90]) for name, seconds, said in rows]))
    print(f"with posekit {posekit.__version__}: {sum(row[1] for row in rows):.0f} s together")


if __name__ == "__main__":
    main()
