"""People through frames: detections and who is who in them, paths through recovered frames, live tracking."""
