"""`posekit synth`: make synthetic views that contain the true postures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from posekit.cli.command import Command, apply, numbers, option, output, reading, say
from posekit.errors import refusal

if TYPE_CHECKING:
    from posekit.cameras import View


@click.group("synth", no_args_is_help=True)
def synth() -> None:
    """Make synthetic views of known postures: a walker, random valid postures, motion capture, or a robot."""


def shared(frames: int, noise_unit: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Declare the options that all subcommands of `synth` share."""
    return apply(
        output("VIEW", "View file to write, .json."),
        option("--frames", default=frames, type=click.IntRange(1), metavar="N", help="Frames."),
        option(
            "--noise",
            default=0.0,
            type=click.FloatRange(0),
            metavar=noise_unit,
            help="Noise of the image points.",
        ),
        option("--seed", default=0, type=click.IntRange(0), help="Seed of the random numbers."),
    )


@synth.command("walker", cls=Command, examples=["posekit synth walker -o walk.json --camera 400,0,0"])
@shared(5, "CM")
@option("--camera", default="400,0,0", metavar="X,Y,Z", help="Camera in the head's frame, cm.")
@option("--dt", default=0.2, type=click.FloatRange(0), metavar="S", help="Seconds between frames.")
@option("--velocity", default=1.0, help="Leg lengths per second, 0.5 to 1.3.")
@option("--lean", default=0.0, metavar="DEGREES", help="Additional forward lean of the back.")
@option("--phase", default=0.0, metavar="CYCLES", help="Phase of the first frame.")
def walker(
    output: Path,
    frames: int,
    noise: float,
    seed: int,
    camera: str,
    dt: float,
    velocity: float,
    lean: float,
    phase: float,
) -> None:
    """Make a view of a walking person by Lee & Chen's camera, with the gait of Boulic, Thalmann & Thalmann (1990)."""
    import math

    from posekit.synthesis import Walker, walker_view

    place = numbers("--camera", camera, 3)
    person = Walker(velocity=velocity, lean=math.radians(lean))
    view = walker_view(person, camera=[x / 100 for x in place], frames=frames, dt=dt, phase0=phase)
    write(view, output, noise / 100, seed)


@synth.command("random", cls=Command, examples=["posekit synth random -o random.json --frames 100"])
@shared(1, "PX")
@option("--distance", default="2.5,6", metavar="MIN,MAX", help="Distances of the cameras, m.")
@option("--uncalibrated", is_flag=True, help="Write the view without its camera.")
def random(output: Path, frames: int, noise: float, seed: int, distance: str, uncalibrated: bool) -> None:
    """Make a view of random valid postures, each seen by a camera at a random point of a sphere."""
    import numpy as np

    from posekit.synthesis import random_views

    near, far = numbers("--distance", distance, 2)
    views = random_views(frames, np.random.default_rng(seed), distance=(near, far))
    write(views, output, noise, seed, uncalibrated)


@synth.command("mocap", cls=Command, examples=["posekit synth mocap jump.bvh -o jump.json --noise 2"])
@click.argument("source", metavar="MOTION", type=click.Path(path_type=Path))
@shared(60, "PX")
@option("--clip", default="", metavar="NAME", help="Recording of the file. Default: the first.")
@option(
    "--dt",
    default=None,
    type=float,
    metavar="S",
    help="Seconds between frames. Default: evenly over the clip.",
)
@option(
    "--camera",
    default="",
    metavar="X,Y,Z",
    help="Camera in the file's world, m. Default: drawn from the seed.",
)
@option("--uncalibrated", is_flag=True, help="Write the view without its camera.")
@reading(urdf=False)
def mocap(
    source: Path,
    output: Path,
    frames: int,
    noise: float,
    seed: int,
    clip: str,
    dt: float | None,
    camera: str,
    uncalibrated: bool,
    **facts: Any,
) -> None:
    """Make a view of motion capture by a virtual camera at a fixed position."""
    import numpy as np

    from posekit.formats import open as open_file
    from posekit.motion import Motion
    from posekit.synthesis import mocap_view

    motion = open_file(source, **facts)
    if not isinstance(motion, Motion):
        raise refusal(source, "", f"a {type(motion).__name__}", "motion", "give a file of motion")
    place = numbers("--camera", camera, 3) if camera else None
    rng = np.random.default_rng(seed)
    view = mocap_view(motion, rng, clip=clip, frames=frames, dt=dt, position=place)
    write(view, output, noise, seed, uncalibrated)


@synth.command("object", cls=Command, examples=["posekit synth object panda -o panda.json"])
@click.argument("robot", metavar="NAME|URDF")
@shared(1, "PX")
def object_command(robot: str, output: Path, frames: int, noise: float, seed: int) -> None:
    """Make a view of random robot configurations within joint limits, from random directions, without perspective."""
    import json

    import numpy as np

    from posekit.files import write_bytes
    from posekit.recovery.objects import load_linkage
    from posekit.robots import load_robot
    from posekit.synthesis import object_document, object_view

    points = load_linkage(robot).points
    loaded, rng = load_robot(robot, bodies="none"), np.random.default_rng(seed)
    image, truth = object_view(loaded, points, frames, rng, noise=noise)
    write_bytes(output, json.dumps(object_document(points, image, truth), indent=1).encode() + b"\n")
    say(str(output))


def write(view: View, output: Path, noise: float, seed: int, uncalibrated: bool = False) -> None:
    """Add noise to a view, remove its camera if requested, and write it."""
    import numpy as np

    from posekit import save
    from posekit.synthesis import forget_camera, with_noise

    seen = with_noise(view, noise, np.random.default_rng([seed, 1])) if noise else view
    save(forget_camera(seen) if uncalibrated else seen, output)
    say(str(output))
