"""What is attacked: whole files of every kind that posekit makes, the commands that read them, and their options."""

from __future__ import annotations

import random
import shutil
import signal
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
import typer.main

from benchmarks.fuzz.others import (
    write_body_angles,
    write_cameras_of_others,
    write_choices,
    write_lines,
    write_object_views,
    write_points_of_others,
    write_robot_folders,
)
from posekit.batch.view_table import write_view_table
from posekit.cli.main import application
from posekit.formats.keypoints import key_point_formats
from posekit.formats.own import View, read_view, schema_text
from posekit.linkages.reading import load_linkage
from posekit.robots.find import find
from posekit.samples import write_samples
from tests.detector_files import view_keypoints, write_keypoints

MOTION_ENDINGS: Final = ("bvh", "trc", "c3d", "mot", "glb", "csv", "parquet", "npz", "json")
POSTURE_COMMANDS: Final = (
    "validate IN -o OUT.json",
    "inspect IN",
    "convert IN OUT.bvh",
    "convert IN OUT.npz",
)
RESULT_COMMANDS: Final = (
    *POSTURE_COMMANDS,
    "convert IN OUT.trc",
    "convert IN OUT.rrd",
    "convert IN OUT.json --to postures",
    "convert IN OUT.parquet --posture all",
    "render IN -o OUT.html",
)
COMMANDS: Final = {
    "motion": (*POSTURE_COMMANDS, "evaluate IN -o OUT.json --frames-per-clip 1 --yaw-step 180"),
    "result": RESULT_COMMANDS,
    "view": ("recover IN -o OUT.json", "inspect IN", "recover IN -o OUT.npz --deviation 1"),
    "key points": ("inspect IN", "recover IN -o OUT.json --fov 60 --stature 175cm --size 1920x1080"),
    "points": ("inspect IN", "validate IN -o OUT.json --rate 30", "convert IN OUT.npz --fps 30"),
    "camera": ("recover SEEDS/keypoints -o OUT.json --stature 175cm --camera IN",),
    "ranges": ("validate SEEDS/walk.npz -o OUT.json --ranges IN",),
    "profile": ("validate SEEDS/walk.npz -o OUT.json --profile IN",),
    "linkage": ("recover SEEDS/STEM.json -o OUT.json --linkage IN --scale min", "inspect IN"),
    "skeleton": ("inspect SEEDS/coco.json --skeleton IN",),
    "motion skeleton": (
        "inspect SEEDS/motion.trc --skeleton IN",
        "convert SEEDS/motion.csv OUT.bvh --skeleton IN",
    ),
    "robot": ("validate SEEDS/person/configurations.npz -o OUT.json --urdf IN", "inspect IN"),
    "robot motion": ("validate IN -o OUT.json --urdf g1", "inspect IN"),
    "report": ("inspect IN",),
    "object": (
        "inspect IN",
        "convert IN OUT.trc",
        "render IN -o OUT.html",
        "validate IN -o OUT.json --urdf panda",
    ),
    "survivors": ("inspect IN", "validate IN -o OUT.json"),
    "postures": POSTURE_COMMANDS,
    "body angles": ("inspect IN", "validate IN -o OUT.json --body-model SEEDS/model.npz"),
    "body model": ("validate SEEDS/angles.npz -o OUT.json --body-model IN",),
    "figure folder": POSTURE_COMMANDS,
    "arm folder": (
        "validate SEEDS/arm.csv -o OUT.json --checks joint-range,collision --urdf IN/arm.urdf",
        "validate SEEDS/arm.csv -o OUT.json --checks joint-range,collision --urdf IN/arm.urdf --srdf IN/arm.srdf",
    ),
    "arm motion": (
        "validate IN -o OUT.json --checks joint-range,collision --urdf SEEDS/arm/arm.urdf",
        "inspect IN",
    ),
    "COLMAP folder": ("recover SEEDS/keypoints -o OUT.json --stature 175cm --camera IN",),
    "batch folder": (
        "inspect IN",
        "validate IN/shards -o OUT.json",
        "batch SEEDS/walk.json -o IN --jobs 1",
    ),
    "view table": ("batch IN -o OUT --jobs 1", "inspect IN"),
    "live lines": (
        "follow --stdin --size 1280x720 --stature 175cm < IN",
        "follow --stdin --size 1280x720 --stature 175cm --keep-going < IN",
    ),
    "nearer": ("recover SEEDS/photo.json -o OUT.json --nearer IN", "inspect IN"),
    "lengths": (
        "recover SEEDS/keypoints -o OUT.json --camera SEEDS/calibration.toml --lengths IN --stature 175cm",
        "inspect IN",
    ),
}
"""Commands by kind of file: IN is the damaged file, OUT what is written, SEEDS the folder of whole files, STEM
its name; of a damaged file in a folder IN is the folder. What follows < is read from standard input."""
OPTION_COMMANDS: Final = (
    "recover SEEDS/walk.json -o OUT.json",
    "recover SEEDS/photo.json -o OUT.npz",
    "recover SEEDS/keypoints -o OUT.json --camera SEEDS/calibration.toml --stature 175cm",
    "validate SEEDS/walk.npz -o OUT.json",
    "validate SEEDS/robot.npz -o OUT.json --urdf g1",
    "convert SEEDS/walk.npz OUT.bvh",
    "convert SEEDS/result.npz OUT.trc",
    "inspect SEEDS/result.json",
    "render SEEDS/result.json -o OUT.html --view SEEDS/walk.json",
    "evaluate SEEDS/walk.npz -o OUT.json --frames-per-clip 2 --yaw-step 180",
    "synth walker -o OUT.json",
    "synth random -o OUT.json",
    "synth object ur5 -o OUT.json",
    "synth mocap SEEDS/walk.npz -o OUT.json",
    "follow --stdin --size 1280x720 --stature 175cm < SEEDS/lines.jsonl",
    "validate SEEDS/arm.csv -o OUT.json --urdf SEEDS/arm/arm.urdf --checks joint-range,collision",
    "batch SEEDS/walk.json -o OUT --jobs 1",
    "samples OUT",
)
KILLED_COMMANDS: Final = (
    *OPTION_COMMANDS,
    "batch SEEDS/keypoints -o OUT --jobs 1",
    "reproduce taylor -o OUT --no-pictures",
)
ODD_VALUES: Final = (
    *(
        "nan",
        "inf",
        "-inf",
        "-1",
        "0",
        "",
        " ",
        "1e308",
        "1e308cm",
        "9" * 30,
        "1,2,3",
        "0,0",
        "x",
        "-",
        "--",
        "a:b",
        "1:2",
    ),
    *(
        "../..",
        "/",
        "/dev/null",
        "/dev/zero",
        "SEEDS",
        "SEEDS/walk.npz",
        "SEEDS/photo.json",
        "\x1b[31m",
        "ä\u202e",
        "%s",
    ),
    *(
        "1e-320",
        "0x10",
        "175",
        "175cm",
        "1cm",
        "2deg",
        "min",
        "all",
        "+y",
        "largest",
        "1-",
        "3-1",
        "0x0",
        "1x1",
        "99999x99999",
    ),
)


class Case(NamedTuple):
    """One attack: its kind, the arguments, and the damaged file with its name, or its place in a folder."""

    kind: str
    arguments: list[str]
    name: str = ""
    data: bytes = b""
    killed_by: int = 0
    killed_after: float = 0.0


def write_seeds(folder: Path, run: Callable[[list[str]], int]) -> dict[str, list[Path]]:
    """Write whole files of every kind; `run` runs a command."""
    write_samples(folder)
    for path, kept in ((folder / "robot.npz", 20), (folder / "walk.npz", 40)):
        with np.load(path) as held:  # fewer frames are more attacks
            arrays = {name: held[name] for name in held.files}
        frames = {name: array[:kept] for name, array in arrays.items() if array.shape[:1] == (90,)}
        np.savez(path, **(arrays | frames))
    seeds: dict[str, list[Path]] = {kind: [] for kind in COMMANDS}
    for ending in MOTION_ENDINGS:
        path = folder / f"motion.{ending}"
        if run(["convert", str(folder / "walk.npz"), str(path)]) == 0:
            seeds["motion"].append(path)
    for name, source in (("result", "walk.json"), ("photo", "photo.json")):
        for ending in ("json", "npz"):
            path = folder / f"{name}.{'out.' if name == 'photo' else ''}{ending}"
            run(["recover", str(folder / source), "-o", str(path)])
            seeds["result"].append(path)
    run(["synth", "random", "-o", str(folder / "random.json"), "--frames", "2"])
    seeds["view"] = [folder / "walk.json", folder / "photo.json", folder / "random.json"]
    view = read_view(folder / "random.json")
    seeds["key points"] = _write_key_points(folder, view)
    seeds["camera"] = write_cameras_of_others(folder)
    seeds["points"] = write_points_of_others(folder)
    seeds |= write_choices(folder) | write_body_angles(folder) | write_robot_folders(folder)
    seeds |= write_lines(folder)
    run(["convert", str(folder / "walk.npz"), str(folder / "person"), "--to", "urdf"])
    run(["batch", str(folder / "walk.json"), "-o", str(folder / "batch"), "--jobs", "1"])
    for kind, made in (("figure", "person"), ("batch", "batch")):
        seeds[f"{kind} folder"] = sorted(path for path in (folder / made).rglob("*") if path.is_file())
    run(["convert", str(folder / "walk.npz"), str(folder / "postures.json"), "--to", "postures"])
    seeds["postures"] = [folder / "postures.json", folder / "person" / "configurations.npz"]
    write_view_table(folder / "table.parquet", read_view(folder / "walk.json"))
    seeds["view table"] = [folder / "table.parquet"]
    for ending in ("json.gz", "parquet"):
        run(["recover", str(folder / "walk.json"), "-o", str(folder / f"result.{ending}")])
        seeds["result"].append(folder / f"result.{ending}")
    gripper = ["recover", str(folder / "gripper.json"), "-o", str(folder / "object.json")]
    run([*gripper, "--linkage", "panda", "--scale", "closure"])
    seeds["object"] = [folder / "object.json"]
    for ending in ("csv", "parquet"):
        path = folder / f"survivors.{ending}"
        run(["convert", str(folder / "result.npz"), str(path), "--posture", "all"])
        seeds["survivors"].append(path)
    seeds |= _built_in_tables(folder)
    seeds["robot motion"] = [folder / "robot.npz"]
    run(["validate", str(folder / "walk.npz"), "-o", str(folder / "report.json")])
    (folder / "schema.json").write_text(schema_text("view"), encoding="utf-8")
    seeds["report"] = [folder / "report.json", folder / "schema.json"]
    lacking = [path.name for files in seeds.values() for path in files if not path.exists()]
    if lacking:
        raise RuntimeError(f"seeds could not be written: {', '.join(lacking)}")
    return seeds


def _write_key_points(folder: Path, view: View) -> list[Path]:
    """Write what detectors would of a view, in every format; return the files."""
    found: list[Path] = []
    for name in key_point_formats():
        path = folder / (f"{name}.csv" if name in ("deeplabcut",) else f"{name}.json")
        try:
            write_keypoints(path, view_keypoints(view, name), name)
        except (OSError, KeyError, ValueError):
            continue
        found += [path] if path.is_file() else sorted(path.glob("*.*"))[:1]
    shutil.copy(next(iter((folder / "keypoints").iterdir())), folder / "openpose_keypoints.json")
    found.append(folder / "openpose_keypoints.json")
    write_keypoints(folder / "mediapipe.csv", view_keypoints(view, "mediapipe"), "mediapipe")
    found.append(folder / "mediapipe.csv")
    return found


def _built_in_tables(folder: Path) -> dict[str, list[Path]]:
    """Return the built-in tables and figure by kind, and write a view of each linkage."""
    built_in = Path(find("stick_figure").urdf).parent
    linkages = sorted((built_in / "linkages").glob("*.toml"))
    write_object_views(folder, {path.stem: load_linkage(path).points for path in linkages})
    return {
        "ranges": sorted((built_in / "ranges").glob("*.toml")),
        "profile": sorted((built_in / "profiles").glob("*.toml")),
        "linkage": linkages,
        "skeleton": [built_in / "skeleton_maps" / "coco_17.toml"],
        "motion skeleton": [built_in / "skeleton_maps" / "posekit.toml"],
        "robot": [built_in / "stick_figure.urdf"],
    }


def file_case(
    seeds: dict[str, list[Path]],
    folder: Path,
    rng: random.Random,
    damage: Callable[[bytes, random.Random], bytes],
) -> Case:
    """Damage a file of some kind, and choose a command that reads it."""
    kind = rng.choice([kind for kind, files in seeds.items() if files])
    path = rng.choice(seeds[kind])
    data = damage(path.read_bytes(), rng)
    name = str(path.relative_to(folder)) if path.is_relative_to(folder) else path.name
    command = rng.choice(COMMANDS[kind]).replace("STEM", path.stem)
    return Case(f"{kind} {path.suffix}", command.split(), name, data)


def kill_case(rng: random.Random) -> Case:
    """Let a signal end a whole command after up to two seconds."""
    killer = rng.choice((signal.SIGTERM, signal.SIGINT, signal.SIGKILL))
    arguments = rng.choice(KILLED_COMMANDS).split()
    return Case(f"killed by {killer.name}", arguments, killed_by=killer, killed_after=rng.uniform(0.0, 2.0))


def option_case(rng: random.Random) -> Case:
    """Give a command one to three of its options, with odd values."""
    arguments = rng.choice(OPTION_COMMANDS).split()
    known = _options(*arguments[:2])
    for name, is_flag in rng.sample(known, min(rng.randint(1, 3), len(known))):
        arguments += [name] if is_flag else [name, rng.choice(ODD_VALUES)]
    return Case("options", arguments)


@cache
def _options(first: str, second: str) -> list[tuple[str, bool]]:
    """Return the options of a command, each with whether it is a flag."""
    command: Any = typer.main.get_command(application(first))
    if hasattr(command, "commands"):
        command = command.commands[first]
    if hasattr(command, "commands"):
        command = command.commands[second]
    options = [parameter for parameter in command.params if parameter.opts[0].startswith("-")]
    return [(name, option.is_flag) for option in options for name in option.opts if name != "--help"]
