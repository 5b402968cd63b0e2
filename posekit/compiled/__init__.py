"""Loops that Numba compiles where it is installed: the only room that knows of Numba.

Every loop is plain Python on plain arrays and runs uncompiled too; what runs compiled gives what runs uncompiled.
"""
