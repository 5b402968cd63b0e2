"""What a run was asked: made once, handed down whole, and written into every result."""

from posekit.settings.check import CheckSettings as CheckSettings
