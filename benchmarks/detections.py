"""Survivors of real detections against the triangulated truth: best, first-ranked and median, with their number.

A folder as Pose2Sim has it: ``pose/cam01_json`` … of OpenPose's key points, a calibration (TOML) and a TRC of the same
seconds. The person's lengths come from the TRC's frames after the last picture (another part of the same recording), or
from a stature.

    python benchmarks/detections.py --trial FOLDER [--stature 1.75] [--cameras cam_01,cam_02]
"""

from __future__ import annotations

import argparse
import tempfile
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

from posekit.body.anthropometry import lengths_from_postures, write_lengths
from posekit.evaluate import compare
from posekit.evaluate.comparison import Comparison
from posekit.formats.cameras import read_cameras
from posekit.formats.markdown import table_lines
from posekit.formats.motion import postures_of, read_motion
from posekit.recovery import recover
from posekit.views.given_views import given_views
from posekit.views.opened import Opened
from posekit.views.source import Source


def trial(folder: Path, names: list[str], stature: float) -> list[str]:
    """Recover every camera with both sources of lengths."""
    calibration, truth = next(folder.glob("*.toml")), next(folder.glob("*.trc"))
    cameras = read_cameras(calibration)
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        for name in names or list(cameras):
            pictures = folder / "pose" / f"{name.replace('_', '')}_json"
            recording = Path(scratch) / "lengths.toml"
            write_lengths(recording, after(truth, len(list(pictures.glob("*.json")))))
            source = Source(camera=f"{calibration}:{name}")
            for says, one in (
                ("recording", replace(source, lengths=recording)),
                (f"stature {stature:g} m", replace(source, stature=stature)),
            ):
                rows.append([name, says, *figures(given_views(pictures, one, truth)[0])])
    head = (
        "camera",
        "lengths",
        "truth off, px",
        "frames",
        "survivors",
        "best of N",
        "first-ranked",
        "median of N",
        "s",
    )
    return [
        "mean joint error, mm: where it is / moved to the true middle; medians over frames",
        "",
        *table_lines(head, rows),
    ]


def after(truth: Path, pictures: int):
    """Return the lengths of the frames of a recording that no picture shows."""
    motion = read_motion(truth)
    return lengths_from_postures(postures_of(motion).joints[pictures:]).lengths


def figures(one: Opened) -> list[str]:
    """Recover, and say what came out."""
    start = time.process_time()
    recovery = recover(one.view)
    seconds = time.process_time() - start
    told = compare(recovery, one.view.truth)
    found = int(np.isfinite(told.best[:, 0]).sum())
    return [
        one.says[-1].split()[-3],
        f"{found} of {len(told.survivors)}",
        f"{np.median(told.survivors):.0f}",
        *(errors(told, name) for name in ("best", "first", "middle")),
        f"{seconds:.1f}",
    ]


def errors(told: Comparison, name: str) -> str:
    """Show two measures in millimetres."""
    values = np.nanmedian(getattr(told, name)[:, :2], axis=0) * 1000
    return f"{values[0]:.0f} / {values[1]:.0f}"


def main() -> None:
    """Run."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trial", type=Path, required=True)
    parser.add_argument("--stature", type=float, default=1.75)
    parser.add_argument("--cameras", default="")
    args = parser.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    names = [name for name in args.cameras.split(",") if name]
    print("\n".join(trial(args.trial, names, args.stature)))


if __name__ == "__main__":
    main()
