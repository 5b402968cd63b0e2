"""What is recovered from some views stays what it was: counts, cameras, reasons, joints and margins, beside those kept.

A change here changes results of others: it is meant, said in CHANGELOG, and kept anew by
``python tests/recovery/test_results_stay.py``.
"""

import json
import tempfile
from pathlib import Path
from typing import Any

import pytest

from posekit.samples import write_samples
from tests.kept_files import differences, keep, run

KEPT_RESULTS = Path(__file__).parent / "kept"
EXACT = {
    "walk": ("walk.json",),
    "walk.table1": (
        "walk.json",
        "--ranges",
        "table1",
        "--checks",
        "rigid-parts,joint-range,collision,walking",
    ),
    "random": ("random.json",),
    **{f"random.{root}": ("random.json", "--root", root) for root in ("head", "torso", "search")},
    **{f"headless.{root}": ("headless.json", "--root", root) for root in ("torso", "search")},
    "inferred": ("headless.json", "--infer"),
    "photo": ("photo.json",),
    "photo.taylor": ("flat.json", "--proportions", "taylor"),
    "gripper": ("gripper.json", "--linkage", "panda", "--scale", "closure"),
}
"""Names of cases, and what is recovered how."""


def write_views(folder: Path) -> None:
    """Write the views: posekit's samples, bodies from anywhere, and these without heads and feet."""
    write_samples(folder)
    run("synth", "random", "-o", folder / "random.json", "--frames", "3", "--seed", "5")
    run("synth", "random", "-o", folder / "flat.json", "--frames", "2", "--seed", "6", "--uncalibrated")
    view = json.loads((folder / "random.json").read_text(encoding="utf-8"))
    for frame in view["frames"]:
        frame.pop("head_image", None)
        frame.pop("truth", None)
        del frame["image"]["left_ankle"]
    (folder / "headless.json").write_text(json.dumps(view), encoding="utf-8")


def result(folder: Path, case: str) -> Any:
    """Recover, and return what is kept: all that is said of frames, and two of the postures of each."""
    file, *options = EXACT[case]
    output = folder / f"{case}.result.json"
    said = run("recover", folder / file, "-o", output, *options)
    if not output.exists():
        return {"refused": said.replace(str(folder), "")}
    frames = json.loads(output.read_text(encoding="utf-8"))["frames"]
    for frame in frames:
        for name in ("set", "answer", "pruned", "q"):
            frame.pop(name, None)
        for name in ("postures", "solutions"):
            if name in frame:
                frame[name] = [len(frame[name]), *frame[name][:2]]
    return frames


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("views")
    write_views(folder)
    return folder


@pytest.mark.parametrize("case", EXACT)
def test_what_is_recovered_stays(case: str, views: Path) -> None:
    assert differences(KEPT_RESULTS / f"{case}.json", result(views, case)) == []


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        write_views(Path(made))
        for each in EXACT:
            keep(KEPT_RESULTS / f"{each}.json", result(Path(made), each))
