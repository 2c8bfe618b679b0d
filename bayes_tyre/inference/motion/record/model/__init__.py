"""The model of one recording: the window that is fitted, its parameters, and the readings that they predict."""
