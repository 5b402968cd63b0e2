"""What was looked into once: studies that no command reaches, not installed."""
