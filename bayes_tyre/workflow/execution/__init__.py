"""The same work on many files: executors here or on a cluster, a cache of results, and resumed runs."""
