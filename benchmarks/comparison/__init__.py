"""The report of `python -m benchmarks`: one file a question, every ratio measured in one run."""
