"""The same work on many files: in processes here or on a cluster, kept as it is done, resumed."""
