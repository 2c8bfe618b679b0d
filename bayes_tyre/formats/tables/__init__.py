"""Tables on disk: each format, how a CSV file is written, and a lab's names and units turned into ours."""
