"""Noise on the image points: how often a posture survives, and how near the best one is.

    python benchmarks/noise.py [--views 200]

Random legal postures seen from 2.5 to 6 m with f = 1500 px. Default tolerances. The neck comes from the head (PnP on
six noisy points), or is given. Prints a Markdown table.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import replace

import numpy as np

from posekit.body import load_figure
from posekit.formats.markdown import table_lines
from posekit.recovery import recover
from posekit.synthesis import random_views
from posekit.views.builtin import view_of

NEAR_METRES = 0.035
"""Metres of mean joint error within which a survivor counts as near the truth."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--views", type=int, default=200)
    views = parser.parse_args().views
    warnings.simplefilter("ignore")  # misfits of noisy heads are expected here
    scene = random_views(load_figure(), views, np.random.default_rng(0))
    rows = []
    for pixels in (0.0, 0.25, 0.5, 1.0, 2.0):
        seen = view_of(scene.with_noise(pixels, np.random.default_rng(1)) if pixels else scene)
        given = replace(seen, root=scene.joints_cam[:, 0], head_image=np.full(seen.head_image.shape, np.nan))
        for root, view in (("from the head", seen), ("given", given)):
            frames = recover(view).frames
            counts = np.array([len(frame) for frame in frames])
            errors = np.array(
                [
                    np.linalg.norm(frame.joints - truth, axis=-1).mean(axis=1).min(initial=np.inf)
                    for frame, truth in zip(frames, scene.joints_cam, strict=True)
                ]
            )
            best = np.median(errors[counts > 0]) * 100
            rows.append(
                (
                    f"{pixels:g}",
                    root,
                    f"{(counts == 0).mean():.0%}",
                    f"{np.median(counts):.0f}",
                    f"{best:.2g}",
                    f"{(errors < NEAR_METRES).mean():.0%}",
                )
            )
    head = (
        "noise, px",
        "neck",
        "frames without a posture",
        "survivors, median",
        "best survivor, median joint error, cm",
        "frames with a survivor within 3.5 cm",
    )
    print("\n".join(table_lines(head, rows)))


if __name__ == "__main__":
    main()
