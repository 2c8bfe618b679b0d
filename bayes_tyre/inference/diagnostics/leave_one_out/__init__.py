"""What a model predicts of a record, or a case, that it has not seen."""
