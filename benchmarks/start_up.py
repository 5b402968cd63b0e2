"""Start-up: `posekit --help` and `import posekit`, each in a fresh process.

python benchmarks/start_up.py [--runs 10]
"""

from __future__ import annotations

import argparse
import statistics
import subprocess
import sys
import time


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=10)
    runs = parser.parse_args().runs
    commands = {
        "python -c pass": ["-c", "pass"],
        "import posekit": ["-c", "import posekit"],
        "posekit --help": [
            "-c",
            "import sys; sys.argv = ['posekit', '--help']; from posekit.cli import main; main()",
        ],
        "import posekit, load_figure()": ["-c", "import posekit; posekit.load_figure()"],
    }
    for name, arguments in commands.items():
        seconds = []
        for _ in range(runs):
            start = time.perf_counter()
            subprocess.run([sys.executable, *arguments], check=True, stdout=subprocess.DEVNULL)
            seconds.append(time.perf_counter() - start)
        print(f"{name:32} median {statistics.median(seconds):.3f} s, worst {max(seconds):.3f} s")


if __name__ == "__main__":
    main()
