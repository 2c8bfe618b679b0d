"""Commands on raw files: `inspect`, `process`, `motion`, `simulate`."""
