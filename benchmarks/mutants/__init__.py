"""Mutation testing: small faults are planted in posekit's source, one at a time, to see whether its tests notice.

    python -m benchmarks.mutants

mutmut and cosmic-ray start a suite for each fault and write into the tree; here a fault costs the tests that run its
line, in a fork of a process that has the libraries loaded, and no file is touched.
"""
