"""Suffixes in the help of commands: those of `bayes_tyre.formats`, which a help has no time to import."""

TABLE = ".csv, .parquet, .xlsx, .mat or .tdx"
#: A `.txt` file is read too, where it is named itself.
RAW = ".lvm, .tdms, .mf4, .mat, .xlsx, .csv, .parquet"
