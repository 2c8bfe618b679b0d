"""What every figure shares: its page, colours, labels, lists of cases, and how it is written."""
