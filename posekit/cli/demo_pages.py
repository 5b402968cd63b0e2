"""Files of `posekit demo`: samples, report of a motion, recovered views, tables of the papers, page with links."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Final

#: Built-in views to recover, and their titles: the walker of Lee & Chen 1985 seen by two cameras.
VIEWS: Final = {
    "seq1": "Every posture behind a view: a walker from the front",
    "seq2": "The same walker before another camera",
}

PAGE: Final = """<!doctype html>
<html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1">
<title>posekit demo</title>
<style>
body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 46rem; margin: 2rem auto; padding: 0 1rem; color: #222 }}
h2 {{ margin-top: 2rem }}
img {{ max-width: 100%; border: 1px solid #ddd }}
code {{ background: #f3f3f3; padding: 0 .2em }}
</style>
<h1>posekit demo</h1>
{sections}
</html>
"""


def write_demo(folder: Path, *, pictures: bool = True) -> Iterator[str]:
    """Write the files of `posekit demo`, and yield one line of text for each step.

    Parameters
    ----------
    folder : Path
        Folder for the files; it is created if it does not exist.
    pictures : bool
        Whether to draw pictures and pages, which need a browser and Pillow.

    Raises
    ------
    PosekitError
        If the folder cannot be written, or no browser is found.
    """
    import posekit
    from posekit.papers import reproduce
    from posekit.samples import samples

    folder.mkdir(parents=True, exist_ok=True)
    samples(folder / "samples")
    yield f"{folder / 'samples'}: files to try every command with"

    jump = folder / "samples" / "jump.bvh"
    report = posekit.validate(jump)
    report.save(folder / "jump.json")
    yield f"jump.bvh: {report.decision}"
    files = ["jump.json"]
    if pictures:
        posekit.render(report, folder / "jump.html", view=posekit.open(jump))
        elbow = next(span for span in report.spans if span.check == "joint-range")
        posekit.render(jump, folder / "jump.png", frame=elbow.worst_frame)
        files = ["jump.png", "jump.html", *files]
    lines = [
        f"The decision about a short clip with defects: {report.decision}.",
        *map(str, report.spans),
        "The picture shows the elbow that is bent backward. The page shows all frames, with findings on a time line.",
    ]
    sections = [
        _section("Is this motion good?", lines, "posekit validate samples/jump.bvh -o jump.html", files)
    ]

    for name, title in VIEWS.items():
        view = posekit.builtin_view(name)
        posekit.save(view, folder / f"{name}.view.json")
        recovery = posekit.recover(view, group=0.05)
        recovery.save(folder / f"{name}.json")
        said = f"{len(recovery.survivors)} postures behind {len(recovery)} frames of the view {name}"
        yield said
        files = [f"{name}.json"]
        if pictures:
            posekit.render(recovery, folder / f"{name}.html", view=view)
            posekit.render(recovery, folder / f"{name}.png", view=view, frame=1)
            files = [f"{name}.png", f"{name}.html", *files]
        lines = [
            f"{said}. Each limb can point toward the camera or away from it.",
            "All of these postures have the same image, the person's lengths, and possible joint angles. "
            "The picture shows four of them with their probabilities, seen from beside the camera.",
        ]
        sections.append(_section(title, lines, f"posekit recover {name}.view.json -o {name}.html", files))

    rows = reproduce("all", folder / "papers", pictures=False)
    yield rows.counts()
    lines = [
        "Numbers that Lee & Chen 1985 and Taylor 2000 print, beside the numbers that posekit finds.",
        rows.counts(),
    ]
    command = "posekit reproduce all -o papers"
    sections.append(_section("The papers, row by row", lines, command, ["papers/papers.html"]))
    (folder / "index.html").write_text(PAGE.format(sections="\n".join(sections)), encoding="utf-8")


def _section(title: str, lines: list[str], command: str, files: list[str]) -> str:
    pictures = "".join(
        f'<p><img src="{escape(name)}" alt="{escape(title)}"></p>' for name in files if name.endswith(".png")
    )
    links = ", ".join(
        f'<a href="{escape(name)}">{escape(name)}</a>' for name in files if not name.endswith(".png")
    )
    text = "".join(f"<p>{escape(line)}</p>" for line in lines)
    return (
        f"<h2>{escape(title)}</h2>{text}{pictures}"
        f"<p>{links}</p><p>The command: <code>{escape(command)}</code></p>"
    )
