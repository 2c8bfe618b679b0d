"""What a result says, in words: its headline, what not to believe, and the numbers behind both."""
