"""Prove that nothing changed that was not meant to: a corpus of commands and Python calls, recorded and compared.

    python -m benchmarks.unchanged record BEFORE --posekit OLD/.venv/bin/posekit --python OLD/.venv/bin/python
    python -m benchmarks.unchanged record AFTER --pythonpath .
    python -m benchmarks.unchanged compare BEFORE AFTER -o report.md

The corpus keeps to what stays: commands, flags, files, and the names of `posekit` itself.
"""
