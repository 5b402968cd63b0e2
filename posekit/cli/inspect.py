"""`posekit inspect`: print the content of a file and the facts that posekit detects in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Final

import click
import numpy as np

from posekit.cli.command import command, reading, say

#: Largest number of names that the table lists.
MOST_NAMES: Final = 40
#: Largest number of detections whose people are tracked and listed, because tracking takes time.
MOST_TRACKED: Final = 2000


@command("inspect", "posekit inspect jump.bvh", "posekit inspect keypoints/")
@click.argument("source", metavar="FILE", type=click.Path(path_type=Path))
@reading()
def inspect(source: Path, **given: Any) -> None:
    """Print the content of a file: kind, layout, frames, rate, axes, unit, names, and warnings."""
    from posekit.formats import open as open_file

    found = open_file(source, **given)
    kind = "cameras" if isinstance(found, dict) else type(found).__name__.lower()
    rows = [("file", str(source)), ("kind", kind), *_facts(found)]
    width = max(len(name) for name, _ in rows)
    say("\n".join(f"{name:<{width}}  {value}" for name, value in rows if value))


def _facts(found: Any) -> list[tuple[str, str]]:
    """Return the rows (name, value) about an object, without rows whose value is empty."""
    if isinstance(found, dict):
        return [(str(name), repr(camera)) for name, camera in found.items()]
    rows = [(name, str(getattr(found, name, "") or "")) for name in ("layout", "unit")]
    kinds = {"Motion": _of_motion, "Detections": _of_detections, "View": _of_view, "Recovery": _of_recovery}
    kind = type(found).__name__
    rows += (
        kinds[kind](found) if kind in kinds else [("holds", getattr(found, "decision", "") or repr(found))]
    )
    rows += [("note", str(note)) for note in getattr(found, "notes", ())]
    rows += [("warning", str(warning)) for warning in getattr(found, "warnings", ())]
    return rows


def _of_detections(found: Any) -> list[tuple[str, str]]:
    numbers = np.asarray(found.frame)
    pictures = len(found.pictures) or (int(numbers.max()) + 1 if len(numbers) else 0)
    film = "a film" if found.film else "unrelated photographs"
    several = found.film and len(np.unique(numbers)) < len(found) <= MOST_TRACKED
    who, counts = np.unique(found.people(), return_counts=True) if several else ((), ())
    listed = _listed(f"{number} in {count}" for number, count in zip(who, counts, strict=True))
    return [
        ("pictures", f"{pictures}, {film}"),
        ("people", f"{len(found)} in {len(np.unique(numbers))} pictures"),
        ("numbers", f"{listed} pictures" if several else ""),
        ("size", f"{found.size[0]} x {found.size[1]} px" if found.size else "not known"),
        ("rate", f"{found.rate:g} a second" if found.rate else "not known (--rate)"),
        ("points", f"{len(found.names)}: {_listed(found.names)}"),
    ]


def _of_view(view: Any) -> list[tuple[str, str]]:
    seen = np.isfinite(view.image).all(axis=-1).mean()
    given = [name for name in ("root", "truth") if np.isfinite(getattr(view, name)).any()]
    given += [f"{name} {getattr(view, name):g}" for name in ("stature", "deviation") if getattr(view, name)]
    return [
        ("frames", str(len(view))),
        ("time", f"{view.time[0]:g} to {view.time[-1]:g} s"),
        ("camera", repr(view.camera)),
        ("seen", f"{seen:.0%} of the joints"),
        ("given", ", ".join(given)),
    ]


def _of_recovery(found: Any) -> list[tuple[str, str]]:
    empty = int((np.bincount(found.survivors.frame, minlength=len(found)) == 0).sum())
    paths = 0 if found.path is None else len(found.path)
    return [
        ("frames", str(len(found)) + (f", {empty} without a posture" if empty else "")),
        ("postures", str(len(found.survivors))),
        ("paths", str(paths) if paths else ""),
        ("ranges", str(found.settings.get("ranges", ""))),
        ("checks", _listed(found.settings.get("checks", ()))),
    ]


def _of_motion(motion: Any) -> list[tuple[str, str]]:
    clips = len(np.unique(np.asarray(motion.clip)))
    rows = [("frames", f"{len(motion)}" + (f" in {clips} recordings" if clips > 1 else ""))]
    rows.append(("rate", f"{motion.rate:g} a second" if motion.rate else "not known (--rate)"))
    time = np.asarray(motion.time)
    if np.isfinite(time).any():
        rows.append(("time", f"{np.nanmin(time):g} to {np.nanmax(time):g} s"))
    rows.append(("up", motion.up or "not known (--up)"))
    if motion.joints is not None:
        known = np.isfinite(motion.joints).all(axis=-1).mean(axis=0)
        names = [f"{n} ({k:.0%})" if k < 1 else n for n, k in zip(motion.joint_names, known, strict=True)]
        rows.append(("points", f"{len(names)}: {_listed(names)}"))
    if motion.q is not None:
        rows.append(("robot", motion.robot or "not known (--urdf)"))
        rows.append(("q", f"{motion.q.shape[1]}: {_listed(motion.q_names)}"))
    if not motion.in_world:
        rows.append(("world", "every frame is relative to its own root"))
    return rows


def _listed(names: Any) -> str:
    names = [str(name) for name in names]
    return ", ".join(names[:MOST_NAMES]) + (", …" if len(names) > MOST_NAMES else "")
