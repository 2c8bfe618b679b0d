"""File suffixes in help texts: a copy of those in `bayes_tyre.formats`, whose import would slow down `--help`."""

TABLE = ".csv, .parquet, .xlsx, .mat or .tdx"
#: A `.txt` file is read too, if the user names the file and not its folder.
RAW = ".lvm, .tdms, .mf4, .mat, .xlsx, .csv, .parquet"
