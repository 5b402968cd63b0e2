"""`posekit synth`: synthetic views, with their truth."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from posekit.cli.guarded_command import GuardedCommand
from posekit.cli.options import Noise, OutputView, Seed, examples, numbers, option
from posekit.cli.terminal import say
from posekit.display.plural import plural
from posekit.errors import InputError

if TYPE_CHECKING:
    from posekit.geometry import Array
    from posekit.synthesis import SyntheticScene

app = typer.Typer(
    help="Make synthetic views with truth: a walker, random legal postures, motion capture, or a robot.",
    epilog=examples("posekit synth walker -o walk.json", "posekit synth random -o random.json --frames 100"),
    rich_markup_mode=None,
)

MOST_FRAMES: Final = 10_000_000
"""Frames that are made at once: above, memory ends."""

Frames = Annotated[int, typer.Option("--frames", min=1, max=MOST_FRAMES, help="How many frames.")]
Uncalibrated = Annotated[
    bool,
    typer.Option(
        "--uncalibrated",
        help="Forget the camera: write the (perspective) pictures as photographs without one.",
    ),
]
Photographs = Annotated[
    Path | None,
    option(
        "--pictures", "FOLDER|FILE.mp4", "Also write what the camera would have seen: PNG files, or a video."
    ),
]
Dt = Annotated[float, typer.Option("--dt", min=0.0, help="Seconds from frame to frame.")]


@app.command(
    cls=GuardedCommand,
    epilog=examples(
        "posekit synth walker -o seq1.json --camera 400,0,0",
        "posekit synth walker -o walk.json --camera 300,0,300 --frames 20 --dt 0.05 --velocity 1.2",
    ),
)
def walker(
    output: OutputView,
    camera: Annotated[
        str, option("--camera", "X,Y,Z", "Camera position in the head's frame, cm: x ahead, y up, z right.")
    ] = "400,0,0",
    frames: Frames = 5,
    dt: Dt = 0.2,
    velocity: Annotated[
        float, typer.Option("--velocity", help="Relative velocity, leg lengths a second, 0.5 to 1.3.")
    ] = 1.0,
    lean: Annotated[
        float, typer.Option("--lean", help="How far the back leans forward besides, degrees, -30 to 30.")
    ] = 0.0,
    phase: Annotated[float, typer.Option("--phase", help="Phase of the first frame, in cycles.")] = 0.0,
    noise: Annotated[
        float,
        typer.Option(
            "--noise",
            min=0.0,
            help="Standard deviation of the image points' noise, cm on the image plane (f = 1 cm: "
            "0.0001 is a good camera's).",
        ),
    ] = 0.0,
    seed: Seed = 0,
) -> None:
    """Walk past a camera of 1985: the gait of Boulic, Thalmann & Thalmann 1990, the body of Table A.1."""
    import numpy as np

    from posekit import synthesis

    x, y, z = numbers(camera, 3, "--camera")
    scene = synthesis.walker_scene(
        synthesis.Walker(velocity=velocity, lean=np.radians(lean)),
        camera=(x / 100, y / 100, z / 100),
        frames=frames,
        dt=dt,
        phase0=phase,
    )
    _write(output, scene, noise / 100, seed)


@app.command(
    cls=GuardedCommand, epilog=examples("posekit synth random -o random.json --frames 100 --noise 1 --seed 7")
)
def random(
    output: OutputView,
    frames: Frames = 1,
    distance: Annotated[str, option("--distance", "MIN,MAX", "Distances of the cameras, metres.")] = "2.5,6",
    noise: Noise = 0.0,
    seed: Seed = 0,
    uncalibrated: Uncalibrated = False,
    pictures: Photographs = None,
) -> None:
    """Draw random legal postures, each seen from anywhere on a sphere around the person."""
    import numpy as np

    from posekit import synthesis
    from posekit.body import load_figure

    near, far = numbers(distance, 2, "--distance")
    sphere = synthesis.CameraSphere(distance=(near, far))
    scene = synthesis.random_views(load_figure(), frames, np.random.default_rng(seed), sphere)
    _write(output, scene, noise, seed, uncalibrated=uncalibrated, pictures=pictures)


@app.command(
    cls=GuardedCommand,
    epilog=examples("posekit synth mocap clips.npz -o view.json --clip walking_1 --frames 30 --dt 0.1"),
)
def mocap(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="An NPZ with joints (T, J, 3) and joint_names.")
    ],
    output: OutputView,
    frames: Frames = 5,
    clip: Annotated[str, typer.Option("--clip", help="The clip, by name. Default: the first.")] = "",
    camera: Annotated[
        str,
        option(
            "--camera",
            "X,Y,Z",
            "Camera position in the file's world, metres. Default: drawn on a sphere around the person.",
        ),
    ] = "",
    dt: Annotated[
        float | None,
        option("--dt", "SECONDS", "Seconds between frames. Default: 0.2; less where the clip is too short."),
    ] = None,
    noise: Noise = 0.0,
    seed: Seed = 0,
    uncalibrated: Uncalibrated = False,
    pictures: Photographs = None,
) -> None:
    """See a motion-capture clip through a virtual camera, with the segment lengths of the clip."""
    import numpy as np

    from posekit import synthesis

    capture = synthesis.read_capture(file)
    position = numbers(camera, 3, "--camera") if camera else None
    name = clip or capture.names[0]
    for step in (0.2, None) if dt is None else (dt,):
        scene = synthesis.mocap_scene(
            capture, name, np.random.default_rng(seed), frames=frames, dt=step, position=position
        )
        if len(scene.joints_cam) == frames:
            break
    else:
        say(
            f"{len(scene.joints_cam)} of {plural(frames, 'frame')}: the clip has no more; name another --clip or --dt"
        )
    _write(output, scene, noise, seed, uncalibrated=uncalibrated, pictures=pictures, up=capture.up)


@app.command(
    "object",
    cls=GuardedCommand,
    epilog=examples("posekit synth object panda -o panda.json --frames 3 --seed 1"),
)
def articulated(
    robot: Annotated[
        str, typer.Argument(metavar="NAME|URDF", help="A robot: panda, ur5, allegro, or a URDF.")
    ],
    output: OutputView,
    frames: Frames = 1,
    noise: Noise = 0.0,
    seed: Seed = 0,
) -> None:
    """Draw a robot within its limits, seen from anywhere by a camera of which nothing is known."""
    import numpy as np

    from posekit import objects
    from posekit.formats import own as files

    _check_name(output)
    thing = objects.load_object(robot)
    view = objects.draw_view(thing, frames, np.random.default_rng(seed), noise=noise, scale_known=False)
    files.write_object_view(output, view)
    say(f"written: {output} ({plural(frames, 'frame')} of {', '.join(thing.linkage.points)})")


def _check_name(output: Path) -> None:
    if output.suffix.lower() != ".json":
        raise InputError(f"-o {output}: a view is JSON; expected a name that ends in .json")


def _write(
    output: Path,
    scene: SyntheticScene,
    noise: float,
    seed: int,
    *,
    uncalibrated: bool = False,
    pictures: Path | None = None,
    up: Array | None = None,
) -> None:
    """Add noise, write the view, in the world whose `up` is known, and the pictures where asked for; say so."""
    from dataclasses import replace

    import numpy as np

    from posekit import views
    from posekit.formats import own as files
    from posekit.safe_io.writing import check_target

    _check_name(output)
    check_target(output)
    if noise > 0:
        scene = scene.with_noise(noise, np.random.default_rng([seed, 1]))
    view = views.view_of(scene)
    view = view if up is None else views.in_world(view, scene, up)
    if noise > 0 and scene.lee_chen_f is None:
        view = replace(view, deviation=noise)
    if pictures is not None:
        from posekit.viewer.overlay import write_photographs

        say(f"written: {pictures} ({plural(write_photographs(pictures, view), 'picture')})")
    files.write_view(output, views.forget_camera(view) if uncalibrated else view)
    say(f"written: {output} ({plural(len(scene), 'frame')})")
