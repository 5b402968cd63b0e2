"""`posekit evaluate`: how good recovery is where the truth is known."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from posekit.cli.asked import settings_of
from posekit.cli.detector_options import Format, Skeleton, Unit
from posekit.cli.detector_source import pixels
from posekit.cli.groups import with_groups
from posekit.cli.judging_options import Judging, TolerancesAsRecover
from posekit.cli.options import Seed, as_recover, distinct, examples, option, options_given, progress, split
from posekit.cli.terminal import say
from posekit.errors import InputError

if TYPE_CHECKING:
    from posekit.formats.own import View
    from posekit.synthesis import Capture

EVALUATE_EXAMPLES = examples(
    "posekit evaluate motion.npz -o report.json -o report.csv --plots",
    "posekit evaluate walk.trc -o report.json --noise 0,2 --heights 1.5m --yaw-step 45",
    "posekit evaluate motion.npz -o report.json --actions walking,running --ranges table1 --jobs 2",
    "posekit evaluate motion.npz -o report.json --sequences --noise 0,2 --yaw-step 45 --heights 1.5m",
    "posekit evaluate view.json -o report.json",
    "posekit evaluate result.npz --truth view.json",
)

SWEEP_OPTIONS = ("--yaw-step", "--heights", "--distance", "--f", "--size")
SAMPLING_OPTIONS = (
    "--frames-per-clip",
    "--clips",
    "--actions",
    "--consecutive",
    "--skeleton",
    "--unit",
    "--up",
)


@with_groups
def evaluate(
    *,
    ctx: typer.Context,
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="Motion (NPZ, TRC, C3D, BVH, CSV, Parquet), seen through virtual cameras; a view with truth; or a "
            "result, with --truth.",
        ),
    ],
    output: Annotated[
        list[Path] | None,
        option(
            "--output",
            "REPORT",
            "The report: .json (everything), .csv (a row a condition) or .md (tables). May be repeated.",
            short="-o",
        ),
    ] = None,
    truth: Annotated[
        Path | None,
        option(
            "--truth", "FILE", "Of a result: a view with truth, or motion; how far off it is, is printed."
        ),
    ] = None,
    noise: Annotated[
        str,
        option(
            "--noise",
            "LIST",
            "Standard deviations of the image points, pixels, by commas. Default: 0,1,2,5,10; of a view 0.",
        ),
    ] = "",
    yaw_step: Annotated[
        float, option("--yaw-step", "DEGREES", "Between cameras, from 0 to 180 degrees.")
    ] = 15.0,
    heights: Annotated[
        str, option("--heights", "LIST", "Of the cameras over the ground, as 0.5m,1.5m.")
    ] = "0.5m,1.5m,2.5m",
    distance: Annotated[str, option("--distance", "LENGTH", "Of the cameras from the body's middle.")] = "4m",
    f: Annotated[float, option("--f", "PX", "Focal length of the cameras, pixels.")] = 1500.0,
    size: Annotated[str, option("--size", "WxH", "Size of their pictures, pixels.")] = "1920x1080",
    frames_per_clip: Annotated[
        int | None,
        option(
            "--frames-per-clip", "N", "Evenly over each clip. Default: 10; with --sequences 60, in a row."
        ),
    ] = None,
    clips: Annotated[str, option("--clips", "LIST", "Only these, by commas. Default: all.")] = "",
    actions: Annotated[
        str, option("--actions", "LIST", "Only clips of these, by commas. Default: all.")
    ] = "",
    consecutive: Annotated[
        bool,
        typer.Option(
            "--consecutive",
            help="Frames in a row from the middle of each clip, seen by cameras that stand still.",
        ),
    ] = False,
    sequences: Annotated[
        bool,
        typer.Option(
            "--sequences", help="Follow the person through frames in a row, and tell how good the path is."
        ),
    ] = False,
    root: Annotated[
        str,
        option(
            "--root",
            "HOW",
            "given: the neck is the true one; auto: it is placed from the image. Default: given; views stay as "
            "they are.",
        ),
    ] = "",
    length_deviation: Annotated[float | None, as_recover("--length-deviation", "FRACTION")] = None,
    coverage: Annotated[float, as_recover("--coverage", "SHARE")] = 0.99,
    judging: Judging,
    tolerances: TolerancesAsRecover,
    format: Format = "",
    skeleton: Skeleton = "",
    unit: Unit = "",
    up: Annotated[
        str, option("--up", "AXIS", "The axis of the motion that points up, as +z. Default: the file's.")
    ] = "",
    seed: Seed = 0,
    jobs: Annotated[int, option("--jobs", "N", "Processes, at most one a core.")] = 1,
    plots: Annotated[
        bool, typer.Option("--plots", help="Draw charts beside the first report: PNG, needs matplotlib.")
    ] = False,
) -> None:
    """Recover views whose truth is known, and say how good the survivors are: retained, how many, how far off."""
    if truth is not None:
        _tell_of_result(file, truth, options_given(ctx))
        return
    if not output:
        raise InputError("-o: no report; expected the name of one; give it, or of a result --truth FILE")
    from posekit import evaluate as evaluation
    from posekit.evaluate.evaluation_charts import plot_paths, write_plots
    from posekit.evaluate.evaluation_report import check_evaluation_path, summary
    from posekit.formats.own import View
    from posekit.viewer.plots.plot_file import drawing

    charts = plot_paths(output[0]) if plots else {}
    distinct(file, *output, *charts.values())
    for path in output:
        check_evaluation_path(path)
    if plots:
        with drawing():  # refuses before the work, not after
            pass
    sweep = evaluation.Sweep(
        yaws=_yaws(yaw_step),
        heights=_heights(heights),
        distance=_length(distance, "--distance"),
        f=f,
        size=pixels(size),
    )
    sampling = evaluation.FrameSampling(
        frames_per_clip=(60 if sequences else 10) if frames_per_clip is None else frames_per_clip,
        clips=split(clips),
        actions=split(actions),
        consecutive=consecutive or sequences,
    )
    options: dict[str, Any] = {
        "root": root or None,
        "settings": settings_of(judging, tolerances, length_deviation=length_deviation, coverage=coverage),
        "seed": seed,
        "choose": evaluation.by_path if sequences else None,
    }
    if noise:
        options["noise"] = _noise(noise)
    method = evaluation.Method(**options)
    given = _read(file, format=format, skeleton=skeleton, unit=unit, up=up)
    if isinstance(given, View):
        for name in options_given(ctx):
            if name in (*SWEEP_OPTIONS, *SAMPLING_OPTIONS):
                raise InputError(
                    f"{name}: a view is evaluated as it is; expected motion; leave the option out"
                )
        if not noise:
            method = evaluation.Method(**{**options, "noise": (0.0,)})
    found = evaluation.evaluate(
        given,
        sampling=sampling,
        sweep=sweep,
        method=method,
        jobs=jobs,
        source=str(file),
        progress=partial(progress, "evaluating"),
    )
    for path in output:
        evaluation.write_evaluation(path, found)
    written = [*output, *(write_plots(output[0], found) if plots else ())]
    for line in summary(found):
        say(line)
    say(f"written: {', '.join(map(str, written))}")


def _tell_of_result(path: Path, truth: Path, given: Iterable[str]) -> None:
    """Print how far a result is from the truth."""
    import numpy as np

    from posekit.cli.true_joints import before_camera
    from posekit.evaluate.comparison import compare
    from posekit.formats.format import Content
    from posekit.formats.motion import postures_of, read_motion
    from posekit.formats.own import read_result
    from posekit.formats.recognising import recognise
    from posekit.skeleton import JOINT

    for name in given:
        if name != "--truth":
            raise InputError(f"{name}: means nothing beside --truth; leave the option out")
    what = recognise(path)
    if what.holds is not Content.RESULT:
        raise InputError(f"{path}: {what.holds.value}; --truth expected a result; leave the option out")
    against = recognise(truth)
    if against.holds not in (Content.VIEW, Content.MOTION):
        raise InputError(
            f"--truth {truth}: {against.holds.value}; expected a view with truth, or motion of the same seconds"
        )
    result = read_result(path)
    joints, said = before_camera(result, truth)
    if against.holds is Content.MOTION:
        joints[:, [JOINT[name] for name in postures_of(read_motion(truth)).derived]] = np.nan
        say(f"truth {truth}: {said}")
    for line in compare(result, joints).lines:
        say(line)


def _read(path: Path, *, format: str, skeleton: str, unit: str, up: str) -> Capture | View:
    """Read motion, or a view."""
    from posekit.formats.format import Content
    from posekit.formats.own import read_view
    from posekit.formats.recognising import recognise
    from posekit.formats.skeleton_maps import load_skeleton_map
    from posekit.synthesis import read_capture

    what = recognise(path, format)
    if what.holds is Content.VIEW:
        return read_view(path)
    if what.holds is not Content.MOTION:
        raise InputError(
            f"{path}: {what.holds.value}, of which no truth is known; expected motion, or a view with truth, or --truth"
        )
    return read_capture(
        path,
        format=what.names[0] if what.names else None,
        unit=unit or None,
        up=up or None,
        layout=load_skeleton_map(skeleton) if skeleton else None,
    )


def _yaws(step: float) -> tuple[float, ...]:
    if not 1 <= step <= 180:
        raise InputError(f"--yaw-step: {step:g} degrees; expected 1 to 180")
    return tuple(min(k * step, 180.0) for k in range(int(180 / step + 1e-9) + 1))


def _heights(text: str) -> tuple[float, ...]:
    return tuple(_length(one, "--heights") for one in split(text))


def _length(text: str, option: str) -> float:
    from posekit.formats.own import parse_length

    return parse_length(text, name=option)


def _noise(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in split(text))
    except ValueError as error:
        raise InputError(f"--noise: {text!r}; expected pixels by commas, as 0,1,2") from error
