"""Attack every reader, command and option with damaged files and nasty values, for as long as is asked.

    python -m benchmarks.fuzz --minutes 60

Each case is a fork of one process that has everything loaded, in a folder of its own, with 4 GB and 20 seconds. It is
clean where the command ends with 0, 1 or 2, refuses in one line and writes nothing then, and writes what posekit reads
again and whose JSON holds finite numbers only.
"""
