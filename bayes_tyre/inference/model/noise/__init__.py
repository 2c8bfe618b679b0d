"""What the noise of records is like beside AR(1): near their start, and where the displacement is off."""
