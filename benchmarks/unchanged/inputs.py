"""Files that the corpus reads and no command writes: those in ``files``, and what is made of synthetic views."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.unchanged.detections import points_of, write_detections

STATIC_FILES = Path(__file__).with_name("files")
SIDE_LETTERS = {"right": "R", "left": "L"}
CAMERA_MATRIX = [[1500.0, 0.0, 960.0], [0.0, 1500.0, 540.0], [0.0, 0.0, 1.0]]
UNSEEN_JOINTS = (("left_wrist",), ("right_elbow", "left_knee"))


def write_inputs(folder: Path, work: Path, data: Path | None) -> None:
    """Write all of them.

    Parameters
    ----------
    folder : Path
        Where they go.
    work : Path
        The folder of all cases, those of `INPUTS_READ` with their views.
    data : Path or None
        The folder of real recordings.
    """
    shutil.copytree(STATIC_FILES, folder)
    views = {case.name: case / "view.json" for case in work.iterdir() if (case / "view.json").is_file()}
    view = _json(views["synth-random"])
    _views(folder, view, _json(views["synth-random-noise"]), _json(views["synth-uncalibrated"]))
    write_detections(folder, [points_of(frame) for frame in view["frames"]])
    np.savez(folder / "camera.npz", mtx=CAMERA_MATRIX, dist=np.zeros(5), image_width=1920, image_height=1080)
    _motion(folder, _json(views["synth-walker-side"]))
    _wrong(folder, view)
    if data is not None:
        (folder / "pose2sim-real").mkdir()
        for path in sorted((data / "pose2sim" / "pose" / "cam01_json").glob("*.json"))[:2]:
            shutil.copy(path, folder / "pose2sim-real")


def _json(path: Path) -> Any:
    return json.loads(path.read_text())


def _write(path: Path, content: Any) -> None:
    path.write_text(content if isinstance(content, str) else json.dumps(content))


def _views(folder: Path, view: Any, noisy: Any, photo: Any) -> None:
    """Write views with joints, necks or heads that were not seen, rounded ones, a photograph, and postures."""
    for source, name in ((view, "hidden"), (noisy, "hidden-noise")):
        frames = [dict(frame, image=dict(frame["image"])) for frame in source["frames"][:2]]
        for frame, unseen in zip(frames, UNSEEN_JOINTS, strict=True):
            for joint in unseen:
                del frame["image"][joint]
        _write(folder / f"{name}.json", source | {"frames": frames})
    neckless = {**view, "frames": [dict(frame, image=dict(frame["image"])) for frame in view["frames"]]}
    del neckless["frames"][1]["image"]["neck"]
    _write(folder / "neckless.json", neckless)
    headless = {**view, "frames": [{k: v for k, v in view["frames"][0].items() if k != "head_image"}]}
    _write(folder / "headless.json", headless)
    rounded = {**view, "frames": [dict(frame) for frame in view["frames"][:2]]}
    for frame in rounded["frames"]:
        for part in ("image", "head_image"):
            frame[part] = {name: [round(u, 1), round(v, 1)] for name, (u, v) in frame[part].items()}
    _write(folder / "rounded.json", rounded)
    _write(
        folder / "photo.json",
        {
            "schema": "posekit.view/1",
            "unit": "m",
            "camera": {"model": "scaled-orthographic", "scale": None},
            "frames": [{"time": 0.0, "image": photo["frames"][0]["image"]}],
        },
    )
    _placed(folder, view)
    nearer = []
    for frame in photo["frames"]:
        depth = {name: place[2] for name, place in frame["truth"].items()}
        ends = ("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee")
        pairs = [(f"{side}_{a}", f"{side}_{b}") for side in ("right", "left") for a, b in ends]
        nearer.append({f"{a}-{b}": min(a, b, key=lambda name: depth[name]) for a, b in pairs})
    _write(folder / "nearer.json", {"schema": "posekit.nearer/1", "frames": nearer})
    postures = [list(frame["truth"].values()) for frame in view["frames"]]
    names = list(view["frames"][0]["truth"])
    torn = [list(place) for place in postures[0]]
    torn[names.index("left_wrist")][2] += 0.4
    unknown = [
        None if name == "right_ankle" else place for name, place in zip(names, postures[1], strict=True)
    ]
    _write(
        folder / "postures.json",
        {
            "schema": "posekit.postures/1",
            "unit": "m",
            "joint_names": names,
            "postures": [*postures, torn, unknown],
        },
    )


def _placed(folder: Path, view: Any) -> None:
    """Write a view whose camera has a place in a world with z up, and the motion in that world."""
    rotation = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    shift = np.array([0.1, 1.0, 0.5])
    camera = view["camera"] | {"R": rotation.tolist(), "t": shift.tolist()}
    _write(folder / "placed.json", view | {"camera": camera})
    truth = np.array([list(frame["truth"].values()) for frame in view["frames"]])
    names, times = list(view["frames"][0]["truth"]), [frame["time"] for frame in view["frames"]]
    np.savez(
        folder / "placed-truth.npz",
        joints=(truth - shift) @ rotation,
        joint_names=np.array(names),
        time=np.array(times),
        up="+z",
    )


def _motion(folder: Path, view: Any) -> None:
    """Write the walker's true joints, turned so that y is up, as motion capture has it."""
    truth = [frame["truth"] for frame in view["frames"]]
    names = list(truth[0])
    scale = {"m": 1.0, "cm": 0.01, "mm": 0.001}[view["unit"]]
    points = np.array([[frame[name] for name in names] for frame in truth]) * scale * [1, -1, -1]
    points -= [0.0, points[:, :, 1].min() - 0.08, points[:, :, 2].mean()]
    frames = len(points)
    np.savez(
        folder / "motion.npz",
        joints=points,
        joint_names=np.array(names),
        clip=np.zeros(frames, dtype=int),
        clip_names=np.array(["walk"]),
        clip_action=np.array(["walking"]),
        clip_fps=np.array([20.0]),
        up="+y",
    )
    short = ["".join(SIDE_LETTERS.get(word, word.capitalize()) for word in name.split("_")) for name in names]
    kept = [k for k, name in enumerate(short) if name not in {"Neck", "Pelvis"}]
    trc = [
        "PathFileType\t4\t(X/Y/Z)\tmotion.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"20\t20\t{frames}\t{len(kept)}\tmm\t20\t1\t{frames}",
        "Frame#\tTime\t" + "\t".join(f"{short[k]}\t\t" for k in kept),
        "\t\t" + "\t".join(f"X{n}\tY{n}\tZ{n}" for n in range(1, len(kept) + 1)),
        "",
    ]
    for k, row in enumerate(points):
        cells = [f"{1000 * x:.4f}" for n in kept for x in row[n]]
        trc.append("\t".join([str(k + 1), f"{k / 20:.3f}", *cells]))
    _write(folder / "motion.trc", "\n".join(trc) + "\n")
    _write(folder / "hostile.trc", "\n".join(trc[:-3]) + "\n")
    rows = ["frame,time,name,x,y,z"]
    for k, row in enumerate(points):
        rows += [
            f"{k},{k / 20},{name},{x},{y},{z}"
            for name, (x, y, z) in zip(names, row.round(6).tolist(), strict=True)
        ]
    _write(folder / "long.csv", "\n".join(rows) + "\n")


def _wrong(folder: Path, view: Any) -> None:
    """Write files that are to be refused."""
    text = json.dumps(view)
    number = str(view["frames"][0]["image"]["neck"][0])
    wrong = {
        "nan": text.replace(number, "NaN", 1),
        "schema": text.replace("posekit.view/1", "posekit.result/1"),
        "newer": text.replace("posekit.view/1", "posekit.view/9"),
        "deep": "[" * 5000 + "]" * 5000,
        "repeated": text.replace('"unit"', '"unit": "cm", "unit"', 1),
        "cut": text[: len(text) // 2],
        "joint": text.replace('"left_knee"', '"left_kne"', 1),
        "huge": text.replace(number, "1e400", 1),
    }
    for name, content in wrong.items():
        _write(folder / f"hostile-{name}.json", content)
    whole = (folder / "motion.npz").read_bytes()
    (folder / "hostile-cut.npz").write_bytes(whole[: len(whole) // 2])
    np.savez(folder / "hostile-pickle.npz", joints=np.array([{"a": 1}, None], dtype=object))
