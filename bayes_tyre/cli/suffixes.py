"""Suffixes in the help of commands: those of `bayes_tyre.formats`, which a help has no time to import."""

TABLE = ".csv, .parquet, .xlsx or .mat"
#: A `.txt` file is read too, where it is named itself.
RAW = ".lvm, .tdms, .xlsx, .csv, .parquet"
