"""One picture a call beside an exact frame of a batch, and live beside that: ratios of one run.

    python benchmarks/live.py [--pictures 60] [--ranges anatomical]

Random postures of one person. Each picture is recovered by a call of its own: exact, and with noise of which the
deviation is known, necks given, lengths as uncertain as given ones are. Beside them an exact frame of a batch of 1,000,
and `posekit.Tracker`, which ranks and follows too. Processor time, after a few calls that load what they need.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable
from functools import partial

import numpy as np

import posekit
from posekit.formats.markdown import table_lines
from posekit.formats.own import OpenCVModel, View
from posekit.synthesis import random_views

BATCH_FRAMES = 1000
LOADING_CALLS = 12


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--pictures", type=int, default=60)
    parser.add_argument("--batch", type=int, default=BATCH_FRAMES)
    parser.add_argument("--pixels", type=float, default=2.0)
    parser.add_argument("--ranges", default="anatomical")
    parser.add_argument(
        "--lengths", type=float, help="how far lengths may be off; as given ones are, if not said"
    )
    asked = parser.parse_args(arguments)
    warnings.simplefilter("ignore")  # a neck that was given lies beside the ray of its noisy point
    settings = posekit.RecoverSettings(ranges=asked.ranges, length_deviation=asked.lengths)
    exact = seen(max(asked.batch, asked.pictures + LOADING_CALLS), 0.0)
    noisy = seen(asked.pictures + LOADING_CALLS, asked.pixels)
    whole = settings.changed(length_deviation=None)
    posekit.recover(exact, whole)  # loads what compiles its loops
    frame = spent(lambda: posekit.recover(exact, whole)) / len(exact)
    tracker = posekit.Tracker(settings, camera=noisy.camera, lengths=noisy.lengths, deviation=noisy.deviation)
    calls: dict[str, Callable[[int], object]] = {
        "exact, one a call": lambda k: posekit.recover(exact.take([k]), whole),
        f"{asked.pixels:g} px, one a call": lambda k: posekit.recover(noisy.take([k]), settings).probability,
        f"{asked.pixels:g} px, live": lambda k: tracker.update(
            noisy.image[k], noisy.time[k], root=noisy.root[k]
        ),
    }
    rows = [("exact, a frame of a batch", f"{1000 * frame:.3f}", "1", f"{1 / frame:,.0f}")]
    for name, call in calls.items():
        for k in range(LOADING_CALLS):
            call(k)
        each = [spent(partial(call, k)) for k in range(LOADING_CALLS, LOADING_CALLS + asked.pictures)]
        mean = float(np.mean(each))
        rows.append((name, f"{1000 * mean:.1f}", f"{mean / frame:.0f}", f"{1 / mean:,.0f}"))
    for line in table_lines(("", "ms", "times an exact frame", "pictures/s"), rows):
        print(line)


def seen(count: int, pixels: float) -> View:
    """Return pictures of random postures of one person, whose neck is known; with noise, and then a deviation."""
    figure, rng = posekit.load_figure(), np.random.default_rng(0)
    scene = random_views(figure, count, rng)
    return View(
        camera=OpenCVModel(K=scene.camera.K, size=scene.size),
        time=np.arange(count) / 30,
        image=scene.with_noise(pixels, rng).image if pixels else scene.image,
        root=scene.joints_cam[:, 0],
        lengths=figure.lengths,
        deviation=pixels or None,
    )


def spent(call: Callable[[], object]) -> float:
    """Return the processor's seconds of a call."""
    start = time.process_time()
    call()
    return time.process_time() - start


if __name__ == "__main__":
    main()
