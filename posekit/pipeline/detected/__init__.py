"""From what detectors and motion capture write to views, and from recoveries back to their truth."""
