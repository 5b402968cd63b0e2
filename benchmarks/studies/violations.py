"""Who violates what: motion of people, and postures that methods find in pictures of them, by every check.

    python -m benchmarks.studies.violations CAPTURE [CAPTURE ...] [--frames 10] [--noise 2] [--seed 0]

A capture is anything that `benchmarks/people.py` reads. Prints the tables of docs, "Violations": the share of frames
whose elbows and knees are beyond their limits by more than 10 and 30 degrees, as Table 4 of Xia et al. 2025
("Reconstructing Humans with a Biomechanically Accurate Skeleton", CVPR; HSMR) counts them; then the share that each
check rejects, and every clip with frames that are not valid.

Pictures are made of the first capture: of every clip so many frames in the middle, in turn from the side and from in
front, with noise in pixels. Taylor's method (2000, equation 2) lifts them with the person's true lengths, at the least
scale and at the true one of each picture, with the true signs, as a person at the screen would give them, and with
random ones. posekit's are the first-ranked and a random survivor of `recover`, by settings as they are; they are judged
by what they were recovered with, too.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.clip_lengths import scene_of
from benchmarks.people import people
from posekit import Validator, recover, validate
from posekit.formats.held_postures import HeldPostures
from posekit.formats.markdown import table_lines
from posekit.formats.own import Postures
from posekit.formats.own.report import columns_of
from posekit.formats.own.report_columns import VerdictColumns
from posekit.geometry import Array
from posekit.recovery.recovered import recovered_with
from posekit.recovery.result import result_of
from posekit.skeleton import JOINTS, PARENTS
from posekit.synthesis import Capture, SyntheticScene
from posekit.views.builtin import view_of

BEYOND_DEGREES = (10.0, 30.0)
LIMB_PLACES = {
    "elbow": ("elbow.flexion", "shoulder.rotation"),
    "knee": ("knee.flexion", "hip.rotation"),
}
"""By hinge: its angle, and the turn of the limb that explains one that bends the wrong way."""

SIDES = ("side", "front")
UP_NAMES = {(0, 1, 0): "+y", (0, 0, 1): "+z"}


@dataclass(frozen=True, kw_only=True, eq=False)
class Moved:
    """Postures in time, from one source.

    Parameters
    ----------
    name : str
        What tables call it.
    joints : array (N, 14, 3)
        Metres.
    clip : int array (N,)
        Which recording each is of.
    rate : array (clips,)
        Frames a second.
    clips : sequence of str
        Their names.
    up : str
        The axis that points up; empty where it is not known.
    own : bool array (N,), optional
        Which are valid by what they were recovered with.
    """

    name: str
    joints: Array
    clip: NDArray[np.intp]
    rate: Array
    clips: Sequence[str]
    up: str = ""
    own: NDArray[np.bool_] | None = None

    @property
    def held(self) -> HeldPostures:
        """The same, as files hold it."""
        frame = np.concatenate([np.arange(count) for count in np.bincount(self.clip) if count])
        return HeldPostures(
            postures=Postures(joints=self.joints),
            frame=frame,
            clip=self.clip,
            time=frame / self.rate[self.clip],
            up=self.up,
        )


def moved(capture: Capture, name: str) -> Moved:
    """Take a whole capture."""
    return Moved(
        name=name,
        joints=capture.points[:, : len(JOINTS)],
        clip=np.asarray(capture.clip, dtype=np.intp),
        rate=np.asarray(capture.fps, dtype=np.float64),
        clips=capture.names,
        up=UP_NAMES.get(tuple(np.round(capture.up).astype(int).tolist()), ""),
    )


def lifted(image: Array, lengths: Array, signs: Array, scale: float | None) -> Array:
    r"""Lift a picture (14, 2) by Taylor's method: :math:`\Delta z^2 = l^2 - |\Delta u|^2 / s^2`.

    Parameters
    ----------
    image : array (14, 2)
        Pixels.
    lengths, signs : array (13,)
        Of the segment that ends in each joint but the neck: metres, and whether its end is farther (1) or nearer (-1).
    scale : float, optional
        Pixels a metre; the least that the lengths allow if not given. Segments that are too long in the picture lie in
        its plane.
    """
    parents = np.array(PARENTS[1:])
    seen = np.linalg.norm(image[1:] - image[parents], axis=-1)
    s = float(np.max(seen / lengths)) if scale is None else scale
    depth = signs * np.sqrt(np.maximum(lengths**2 - (seen / s) ** 2, 0.0))
    joints = np.zeros((len(JOINTS), 3))
    joints[0, :2] = image[0] / s
    for joint in range(1, len(JOINTS)):
        flat = (image[joint] - image[PARENTS[joint]]) / s
        joints[joint] = joints[PARENTS[joint]] + [*flat, depth[joint - 1]]
    return joints


def taylors(scene: SyntheticScene, image: Array, rng: np.random.Generator) -> Iterator[tuple[str, Array]]:
    """Lift the pictures of a scene by Taylor's method in four ways."""
    parents = np.array(PARENTS[1:])
    true = scene.joints_cam[:, 1:] - scene.joints_cam[:, parents]
    lengths = np.median(np.linalg.norm(true, axis=-1), axis=0)
    signs, drawn = np.sign(true[..., 2]), rng.choice([-1.0, 1.0], true.shape[:2])
    scale = scene.camera.K[0, 0] / scene.joints_cam[:, :, 2].mean(axis=1)
    for name, chosen, known in (
        ("Taylor, true signs, least scale", signs, False),
        ("Taylor, true signs, true scale", signs, True),
        ("Taylor, random signs, true scale", drawn, True),
    ):
        yield (
            name,
            np.stack(
                [
                    lifted(image[k], lengths, chosen[k], float(scale[k]) if known else None)
                    for k in range(len(image))
                ]
            ),
        )


def of_pictures(capture: Capture, frames: int, noise: float, seed: int) -> list[Moved]:
    """Find postures in pictures of the middle of every clip, by each method."""
    rng = np.random.default_rng(seed)
    found: dict[str, list[tuple[int, Array]]] = {}
    own: dict[str, list[NDArray[np.bool_]]] = {}
    for clip in range(len(capture.names)):
        scene = scene_of(capture, clip, SIDES[clip % len(SIDES)], frames)
        noisy = scene.with_noise(noise, rng)
        found.setdefault("the same frames, true", []).append((clip, scene.joints_cam))
        for name, joints in taylors(scene, noisy.image[:, : len(JOINTS)], rng):
            found.setdefault(name, []).append((clip, joints))
        recovery = recover(replace(view_of(noisy), deviation=noise))
        judge = Validator(*recovered_with(result_of(recovery)))
        both = [
            (frame.joints[int(np.argmax(each))], frame.joints[int(rng.integers(len(each)))])
            for frame, each in zip(recovery.frames, recovery.probability, strict=True)
            if len(each)
        ]
        for k, name in enumerate(("posekit, first-ranked", "posekit, a random survivor")):
            if both:
                joints = np.stack([one[k] for one in both])
                found.setdefault(name, []).append((clip, joints))
                own.setdefault(name, []).append(judge.check(joints).valid)
    return [
        Moved(
            name=name,
            joints=np.concatenate([joints for _, joints in parts]),
            clip=np.repeat([clip for clip, _ in parts], [len(joints) for _, joints in parts]),
            rate=np.asarray(capture.fps, dtype=np.float64),
            clips=capture.names,
            own=np.concatenate(own[name]) if name in own else None,
        )
        for name, parts in found.items()
    ]


def beyond(source: Moved, validator: Validator) -> list[str]:
    """Return the shares of frames whose elbows and knees, right and left, are beyond by more than each threshold."""
    excess: dict[str, list[Array]] = {}
    for clip in np.unique(source.clip):
        report = validator.check(source.joints[source.clip == clip])
        (ranges,) = (one for one in report.judgements if one.check == "joint_range")
        for hinge, angles in LIMB_PLACES.items():
            for side in ("right", "left"):
                columns = [ranges.where.index(f"{side}_{angle}") for angle in angles]
                excess.setdefault(f"{side} {hinge}", []).append(
                    np.fmax.reduce(-ranges.margin[:, columns], axis=1)
                )
    return [
        f"{np.mean(np.concatenate(parts) > degrees):.1%}"
        for parts in excess.values()
        for degrees in BEYOND_DEGREES
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("captures", type=Path, nargs="*")
    parser.add_argument("--frames", type=int, default=10, help="of each clip that are seen in pictures")
    parser.add_argument("--noise", type=float, default=2.0, help="pixels")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    if not given.captures:
        print("no motion given: python -m benchmarks.studies.violations CAPTURE [CAPTURE ...]")
        return
    warnings.simplefilter("ignore")
    captures = [people(path) for path in given.captures]
    sources = [
        moved(one, path.stem.split("-")[0]) for one, path in zip(captures, given.captures, strict=True)
    ]
    sources += of_pictures(captures[0], given.frames, given.noise, given.seed)
    validator = Validator()
    reports = [columns_of(validate(one.held)) for one in sources]
    hinges = [
        f"{side} {hinge}, {d:g}°"
        for hinge in LIMB_PLACES
        for side in ("right", "left")
        for d in BEYOND_DEGREES
    ]
    rows = [[one.name, str(len(one.joints)), *beyond(one, validator)] for one in sources]
    print("\n".join(table_lines(["beyond by more than", "frames", *hinges], rows)), "\n")
    checks = list(dict.fromkeys(check for one in reports for check in one.checks))
    rows = [
        ["none: valid", *(f"{one.summary['valid'] / len(one):.1%}" for one in reports)],
        ["none, by their result", *("" if one.own is None else f"{one.own.mean():.1%}" for one in sources)],
        *([check.replace("_", " "), *(_share(one, check) for one in reports)] for check in checks),
    ]
    print("\n".join(table_lines(["rejected by", *(one.name for one in sources)], rows)), "\n")
    rows = []
    for one, found in zip(sources[: len(captures)], reports, strict=False):
        for clip in np.unique(one.clip[found.verdict != 0]):
            mine = np.flatnonzero(one.clip == clip)
            bad = np.isin(found.posture, mine)
            names, counts = np.unique(found.place[bad], return_counts=True)
            said = [
                f"{found.places[place].name} {count} (to {found.margin[bad & (found.place == place)].min():.2g} "
                f"{found.places[place].unit})"
                for place, count in sorted(
                    zip(names.tolist(), counts.tolist(), strict=True), key=lambda p: -p[1]
                )
            ]
            rows.append(
                [
                    one.clips[clip],
                    f"{np.count_nonzero(found.verdict[mine])} of {len(mine)}",
                    ", ".join(said[:4]),
                ]
            )
    print("\n".join(table_lines(["clip", "frames not valid", "by, frames and worst margin"], rows)))


def _share(found: VerdictColumns, check: str) -> str:
    count = found.by_check().get(check)
    return "" if count is None else f"{count.rejected / len(found):.1%}"


if __name__ == "__main__":
    main()
