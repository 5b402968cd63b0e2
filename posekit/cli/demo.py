"""`posekit demo`: run validation, recovery and reproduction on small built-in files."""

from __future__ import annotations

from pathlib import Path

from posekit.cli.command import command, option, output, say


@command("demo", "posekit demo -o demo-results")
@output("DIR", "Folder for the results.")
@option("--pictures/--no-pictures", default=True, help="Draw the results, too.")
def demo(output: Path, pictures: bool) -> None:
    """Validate a motion, recover built-in views, and compute the papers' tables; index.html links to the results."""
    from posekit.cli.demo_pages import write_demo

    for line in write_demo(output, pictures=pictures):
        say(line)
    say(f"\nopen {output / 'index.html'}; then try:")
    say("  posekit samples samples")
    say("  posekit validate samples/jump.bvh -o report.html")
    say("  posekit recover samples/walk.json -o postures.html")
