"""Synthetic views with truth: a walker, random legal postures, motion capture; noise and seeds."""
