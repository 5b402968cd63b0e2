"""Checks of motion over time, and profiles of their thresholds."""
