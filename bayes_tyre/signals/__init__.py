"""Raw signals to records: channels in units, the step found, runout removed, displacement and force on the tyre."""
