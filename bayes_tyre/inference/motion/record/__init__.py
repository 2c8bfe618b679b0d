"""One recording: its step, forward model, estimate and evidence."""
