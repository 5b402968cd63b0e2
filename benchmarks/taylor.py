"""Taylor's human: survivors of the 2048 flips and the protocol of section 3.2, on synthetic and on real postures.

    python benchmarks/taylor.py [CAPTURE.npz] [--pictures 1000] [--seed 0]

The capture is an NPZ as `posekit synth mocap` reads it; without one, only random legal postures are studied. Prints
the Markdown tables of docs/taylor.md.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from posekit.papers.taylor_study import capture_study, synthetic_study


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("capture", type=Path, nargs="?")
    parser.add_argument("--pictures", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    print("\n".join(synthetic_study(given.pictures, given.seed).lines()))
    if given.capture is None:
        print("no capture given: python benchmarks/taylor.py CAPTURE.npz")
        return
    print("\n".join(capture_study(given.capture, given.pictures, given.seed).lines()))


if __name__ == "__main__":
    main()
