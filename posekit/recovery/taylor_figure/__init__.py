"""Taylor's figure of 12 points, and the figure's joints completed from it."""
