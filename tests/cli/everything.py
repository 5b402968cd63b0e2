"""Every kind of result against every command and format: the table of docs/reference/everything.md."""

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

from posekit.formats.motion import motion_formats

Command = Callable[..., Any]

COMMANDS = ("validate", "inspect", "render", "view", "evaluate")
ALL_IN = ("csv", "npz", "parquet", "glb")
"""Formats that carry all survivors."""
SUFFIXES = {"rerun": ".rrd", "postures": ".json", "urdf": ""}
FILLED = ("interpolated", "bridged", "held as", "left out", "as in the nearest")
"""What a line says where a file is other than the result, for its format or by default."""

PAGE_HEAD = """# Every result, every command, every format

Made and checked in the tests: each kind of result that `posekit recover` writes, given to each command, and converted
to each format that is written. *yes*: it is done. *filled*: it is done, and a line says which frames or joints were
interpolated, held or left out (`--gaps` chooses). A number is a refusal, with its reason below the table. Kinds, and
commands and formats, that come out alike share a column or a row.
"""


def make_results(folder: Path, command: Command) -> dict[str, Path]:
    """Recover one result of each kind into a folder: the files by their kinds."""

    def recover(what: str, *options: object) -> None:
        done = command("recover", folder / what, *options)
        assert done.code == 0, (what, done.err)

    def changed(name: str, change: Callable[[dict[str, Any]], object]) -> str:
        document = copy.deepcopy(seen)
        change(document["frames"][1]["image"])
        (folder / name).write_text(json.dumps(document))
        return name

    samples = folder / "samples"
    assert command("samples", samples).code == 0
    assert command("synth", "walker", "-o", folder / "walk.json", "--frames", 2).code == 0
    mocap = ("--frames", 3, "--dt", 0.1, "--camera", "4,1,1.5")
    for name, noise in (("seen.json", 0), ("noisy.json", 1)):
        done = command("synth", "mocap", samples / "walk.npz", "-o", folder / name, "--noise", noise, *mocap)
        assert done.code == 0, done.err
    seen = json.loads((folder / "seen.json").read_text())
    for which in ("person", "people"):
        (folder / which).mkdir()
    for path in sorted((samples / "keypoints").iterdir())[:2]:
        frame = json.loads(path.read_text())
        if not list((folder / "person").iterdir()):
            (folder / "person" / path.name).write_text(path.read_text())
        beside = copy.deepcopy(frame["people"][0])
        points = beside["pose_keypoints_2d"]
        points[::3] = [x + 400 if x else 0 for x in points[::3]]
        frame["people"].append(beside)
        (folder / "people" / path.name).write_text(json.dumps(frame))

    hidden = changed("hidden.json", lambda image: [image.pop(f"left_{one}") for one in ("elbow", "wrist")])
    broken = changed(
        "broken.json", lambda image: image.update(dict.fromkeys(("left_wrist", "right_ankle"), image["neck"]))
    )
    stature = ("--stature", "175cm")
    recover("walk.json", "-o", folder / "exact.json")
    recover("walk.json", "-o", folder / "explained.npz", "--explain")
    recover("noisy.json", "-o", folder / "noisy.parquet")
    recover("noisy.json", "-o", folder / "followed.json", "--follow", 2)
    recover(hidden, "-o", folder / "completed.json")
    recover(hidden, "-o", folder / "partial.npz", "--no-infer")
    recover(broken, "-o", folder / "broken_r.json")
    recover("samples/photo.json", "-o", folder / "photo.json")
    recover("person", "-o", folder / "taylor.json", *stature, "--proportions", "taylor", "--size", "1280x720")
    calibration = ("--camera", samples / "calibration.toml", "--person", "all")
    recover("people", "-o", folder / "people.parquet", *stature, *calibration)
    recover("samples/gripper.json", "-o", folder / "gripper.json", "--linkage", "panda", "--scale", "closure")
    return {
        "exact, JSON": folder / "exact.json",
        "exact, NPZ, `--explain`": folder / "explained.npz",
        "noisy, Parquet": folder / "noisy.parquet",
        "followed, `--follow`": folder / "followed.json",
        "joints hidden, completed": folder / "completed.json",
        "joints hidden, `--no-infer`": folder / "partial.npz",
        "a frame without a posture": folder / "broken_r.json",
        "a photograph, no camera": folder / "photo.json",
        "`--proportions taylor`": folder / "taylor.json",
        "one of several people, Parquet": folder / "people.person0.parquet",
        "an object, `--linkage`": folder / "gripper.json",
    }


def columns() -> list[str]:
    """Name what is tried: commands, then formats, then formats with all survivors."""
    formats = ["postures", *(one.name for one in motion_formats().values() if one.writes)]
    return [*COMMANDS, *formats, *(f"{one}, all" for one in ALL_IN)]


def attempt(command: Command, result: Path, column: str, folder: Path) -> Any:
    """Give a result to a command, or convert it."""
    out = folder / f"{result.stem.replace('.', '_')}_{column.replace(', ', '_')}"
    if column in ("validate", "inspect"):
        return command(column, result)
    if column == "render":
        return command("render", result, "-o", out.with_suffix(".html"))
    if column == "view":
        with mock.patch("posekit.viewer.page.server.PageServer.serve_forever"):
            return command("view", result, "--no-open")
    if column == "evaluate":
        return command("evaluate", result, "-o", out.with_suffix(".md"))
    name, _, every = column.partition(", ")
    out = out.with_suffix(SUFFIXES.get(name, f".{name}"))
    return command("convert", result, out, *(("--posture", "all") if every else ()))


def page(cells: dict[str, dict[str, Any]], results: dict[str, Path]) -> str:
    """Write the page: commands and formats down, kinds of result across, and the reasons of refusals."""
    reasons: list[str] = []

    def word(kind: str, column: str) -> str:
        outcome = cells[kind][column]
        if outcome.code in (0, 1):
            return "filled" if column not in COMMANDS and any(one in outcome.out for one in FILLED) else "yes"
        said = outcome.err.strip().removeprefix("posekit: error: ").replace(str(results[kind]), "RESULT")
        said = said.replace(f"got {column.partition(', ')[0]}, of", "got FORMAT, of")
        if said not in reasons:
            reasons.append(said)
        return str(reasons.index(said) + 1)

    table = {column: tuple(word(kind, column) for kind in results) for column in columns()}
    rows = alike(table)
    across = alike(dict(zip(results, zip(*table.values(), strict=True), strict=True)))
    lines = [PAGE_HEAD, f"| | {' | '.join('; '.join(kinds) for kinds in across)} |"]
    lines.append("|---" * (len(across) + 1) + "|")
    place = {kind: k for k, kind in enumerate(results)}
    for columns_alike in rows:
        said = (table[columns_alike[0]][place[kinds[0]]] for kinds in across)
        lines.append(f"| {'; '.join(columns_alike)} | {' | '.join(said)} |")
    lines += ["", *(f"{k}. `{reason}`" for k, reason in enumerate(reasons, start=1))]
    return "\n".join(lines) + "\n"


def alike(words: dict[str, tuple[str, ...]]) -> list[list[str]]:
    """Put names together that have the same words, in the order of the first of each."""
    found: dict[tuple[str, ...], list[str]] = {}
    for name, said in words.items():
        found.setdefault(said, []).append(name)
    return list(found.values())
