"""`posekit recover`: compute every posture that fits a view."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
import numpy as np

from posekit.cli.command import command, option, output, say, seeing, settings_from, settings_options
from posekit.errors import refusal, shown
from posekit.geometry import known_median
from posekit.settings import RecoverSettings

if TYPE_CHECKING:
    from posekit.recovery import Recovery

SHOWN = {"stature": "LENGTH", "deviation": "PX", "checks": "LIST", "follow": "PATHS", "scale": "HOW"}


@command(
    "recover",
    "posekit recover walk.json -o postures.json",
    "posekit recover keypoints/ -o walk.npz --camera calibration.toml:cam_01 --stature 175cm --follow 1",
    "posekit recover photo.json -o photo.html",
    "posekit recover gripper.json -o gripper.out.json --linkage panda --scale closure",
)
@click.argument("source", metavar="VIEW|KEYPOINTS", type=click.Path(path_type=Path))
@output("RESULT", "Result: .json, .json.gz, .npz, .parquet; or .html, its page.")
@seeing()
@option("--unit", default=None, metavar="UNIT", hidden=True, help="Unit of the calibration.")
@option(
    "--fov", type=click.FloatRange(1, 179), metavar="DEGREES", hidden=True, help="Horizontal field of view."
)
@option("--size", default=None, metavar="WxH", hidden=True, help="Width and height of the pictures, pixels.")
@option("--min-confidence", type=float, default=0.0, hidden=True, help="Minimum confidence of a key point.")
@option("--linkage", default="", metavar="NAME|FILE", help="An articulated object in place of a person.")
@option(
    "--explain", is_flag=True, help="Print the rejected branches and their reasons, and why frames are empty."
)
@settings_options(RecoverSettings, SHOWN)
def recover(source: Path, output: Path, explain: bool, linkage: str, **given: Any) -> None:
    """Recover every posture that fits the image points of a view and passes the checks."""
    from posekit.doors import view_of
    from posekit.formats.save import refuse_ending, save
    from posekit.recovery.conductor import recover as recover_view

    settings = settings_from(RecoverSettings, given)
    if linkage:
        say("\n".join(recover_linkage(source, linkage, settings, output)))
        return
    if output.suffix != ".html":
        refuse_ending("Recovery", output)
    view = view_of(source, **given)
    recovery = recover_view(view, settings)
    if output.suffix == ".html":
        from posekit.viewer import draw

        draw(recovery, output, view=view)
    else:
        save(recovery, output)
    say("\n".join(summary(recovery, output)))
    if explain:
        say("\n".join(explained(recovery)))


def recover_linkage(source: Path, name: str, settings: RecoverSettings, output: Path) -> list[str]:
    """Recover an articulated object, such as a robot, from an uncalibrated view; return lines of a summary."""
    import json

    from posekit.files import write_bytes
    from posekit.formats.open import parsed
    from posekit.formats.view_file import read_object
    from posekit.recovery.objects import load_linkage, recover_object
    from posekit.robots import load_robot

    if output.suffix != ".json":
        raise refusal(output, "", shown(output.suffix), ".json for an object's postures", "rename it")
    linkage = load_linkage(name)
    view = read_object(parsed(source)[1], source, linkage.points)
    robot = load_robot(linkage.urdf, bodies="none") if linkage.urdf else None
    found = recover_object(
        linkage,
        view["image"],
        scale=settings.scale if settings.scale is not None else view["scale"],
        aspect=view["aspect"],
        time=view["time"],
        nearer=settings.nearer or (),
        robot=robot,
    )
    write_bytes(output, json.dumps(found.document()).encode() + b"\n")
    lines = [
        f"{output}: {len(found.frame)} postures of {linkage.name} in {len(found)} frame{'s' * (len(found) != 1)}"
    ]
    if found.certified is not None:
        lines.append(
            f"{int(found.certified.sum())} have a configuration within the limits of the robot's joints"
        )
    return lines + [
        f"frame {k}: {about['reason']}" for k, about in enumerate(found.frames) if about["reason"]
    ]


def summary(recovery: Recovery, output: Path) -> list[str]:
    """Return lines of text about the result, its probability, and the next step."""
    counts = np.bincount(recovery.survivors.frame, minlength=len(recovery))
    empty = int((counts == 0).sum())
    frames = f"{len(recovery)} frame{'s' * (len(recovery) != 1)}"
    lines = [f"{output}: {len(recovery.survivors)} postures in {frames}"]
    if empty:
        reasons = [reason for reason in recovery.frames.reason if reason]
        most = max(set(reasons), key=reasons.count) if reasons else "no posture passes the checks"
        lines.append(f"{empty} of {frames} empty: {most}")
    known = counts > 0
    if known.any():
        listed = np.array([len(rows) for rows in recovery.answer.representatives])[known]
        sure = known_median(recovery.answer.sure[known])
        words = next((one for one in recovery.answer.sure_of if one), "position")
        lines.append(
            f"median frame: {int(known_median(counts[known]))} postures, {int(known_median(listed))} that differ; "
            f"every joint of the answer is within 5 cm ({words}) with probability {probability(sure)}"
        )
        unlisted = int(np.sum(np.asarray(recovery.frames.unlisted)))
        if unlisted:
            all_asked = recovery.settings.get("coverage") == 1
            why = "beyond the most that a frame lists" if all_asked else "list them with --coverage 1"
            lines.append(f"{unlisted} improbable postures are counted, not listed; {why}")
    if recovery.path is not None and len(recovery.path):
        lines.append(f"likeliest path through the frames: probability {recovery.path.probability[0]:.2f}")
    if known.any() and output.suffix != ".html":
        lines.append(f"next: posekit render {output} -o postures.html")
    elif not known.any():
        lines.append(
            "next: see the reasons with --explain; allow more with --deviation or --length-deviation"
        )
    return [line for line in lines if line]


def probability(value: float) -> str:
    """Write a probability with two decimals, or as a bound below 0.01."""
    return f"{value:.2f}" if value >= 0.01 else "less than 0.01"


def explained(recovery: Recovery) -> list[str]:
    """Return lines with the number of rejected branches by reason, and why frames have no survivor."""
    from collections import Counter

    lost: Counter[str] = Counter()
    for one in recovery.frames.rejected:
        lost.update(one)
    lines = [f"  {count:8d}  {reason}" for reason, count in lost.most_common()]
    empty = [f"  frame {k}: {reason}" for k, reason in enumerate(recovery.frames.reason) if reason]
    return [*(["rejected branches:"] if lines else []), *lines, *empty]
