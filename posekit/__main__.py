"""The command `posekit`, also as ``python -m posekit``: its signals wait until they can be heard."""

from __future__ import annotations

import signal


def main() -> None:
    """Load the command line and run it; a signal that comes before it can end in one line is held until then."""
    signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT, signal.SIGTERM))
    from posekit.cli.main import main as run

    run()


if __name__ == "__main__":
    main()
