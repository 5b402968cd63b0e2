"""The command `posekit`, also as ``python -m posekit``."""

from __future__ import annotations


def main() -> None:
    """Load the command line and run it."""
    from posekit.cli.main import main as run

    run()


if __name__ == "__main__":
    main()
