"""Taylor's human: survivors of the 2048 flips and the protocol of section 3.2, on synthetic and on real postures.

    python benchmarks/taylor.py [CAPTURE.npz] [--pictures 1000] [--seed 0]

The capture is an NPZ as `posekit synth mocap` reads it; without one, only random legal postures are studied. Prints
the Markdown tables of docs/research/taylor.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from posekit.formats.markdown import table_lines
from posekit.papers.taylor_study import CAMERA_SPHERE, NOISE_PIXELS, Study, photographed, synthetic_study
from posekit.papers.taylor_survival import Survival, survival
from posekit.papers.taylor_views import StudyPictures, exact_views, photographs
from posekit.recovery.taylor_figure.human import Human, taylor_human
from posekit.settings import MEASURED_TOLERANCE, PHOTOGRAPH_TOLERANCE, Tolerance
from posekit.synthesis import mocap_scenes, read_capture


@dataclass(frozen=True, kw_only=True)
class Swept:
    """What all checks together leave at one tolerance."""

    tolerance: Tolerance
    rigid: Survival
    all: Survival


def capture_study(capture: Path, pictures: int, seed: int) -> list[str]:
    """Study real postures, drawn evenly over the clips of a capture, each seen by a camera of its own."""
    scenes = mocap_scenes(read_capture(capture), pictures, np.random.default_rng(seed), sphere=CAMERA_SPHERE)
    human = taylor_human()
    exact = exact_views(human, scenes)
    seen = photographs(human, scenes, noise=NOISE_PIXELS, rng=np.random.default_rng(seed))
    study = Study(
        title="Real motion capture",
        pictures=pictures,
        exact=tuple(survival(human, exact)),
        photographs=tuple(photographed(human, scenes, seed, ("urdf", "table1"))),
    )
    rigid = _sweep(human, exact, MEASURED_TOLERANCE, (0.005, 0.01, 0.02, 0.03, 0.04, 0.06), (2.0,))
    swept = _sweep(human, seen, PHOTOGRAPH_TOLERANCE, (0.03, 0.06, 0.10, 0.15), (2.0, 5.0, 10.0, 15.0))
    return [
        *study.lines(),
        "Exact pictures: the tolerance of rigid parts:",
        "",
        *_swept_lines(list(rigid)),
        "Photographs: the tolerances (the person's own lengths, s from the stature):",
        "",
        *_swept_lines(list(swept)),
    ]


def _sweep(
    human: Human,
    seen: Sequence[StudyPictures],
    base: Tolerance,
    rigid: Sequence[float],
    angle: Sequence[float],
) -> Iterator[Swept]:
    for metres, degrees in product(rigid, angle):
        tolerance = replace(base, rigid=metres, angle=degrees)
        table = {row.checks: row for row in survival(human, seen, tolerance=tolerance, ranges=("urdf",))}
        yield Swept(tolerance=tolerance, rigid=table["rigid parts"], all=table["all, urdf"])


def _swept_lines(table: Sequence[Swept]) -> list[str]:
    head = (
        "rigid parts, cm",
        "angles, deg",
        "rigid parts alone: survivors, median",
        "truth among them",
        "all checks, urdf: survivors, median",
        "mean",
        "truth among them",
        "truth and mirror image",
    )
    rows = [
        (
            f"{one.tolerance.rigid * 100:g}",
            f"{one.tolerance.angle:g}",
            f"{np.median(one.rigid.count):g}",
            f"{one.rigid.truth.mean():.1%}",
            f"{np.median(one.all.count):g}",
            f"{one.all.count.mean():.1f}",
            f"{one.all.truth.mean():.1%}",
            f"{one.all.pair.mean():.1%}",
        )
        for one in table
    ]
    return table_lines(head, rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("capture", type=Path, nargs="?")
    parser.add_argument("--pictures", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    print("\n".join(synthetic_study(given.pictures, given.seed).lines()))
    if given.capture is None:
        print("no capture given: python benchmarks/taylor.py CAPTURE.npz")
        return
    print("\n".join(capture_study(given.capture, given.pictures, given.seed)))


if __name__ == "__main__":
    main()
