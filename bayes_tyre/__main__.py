"""`python -m bayes_tyre`: the same as the command `bayes-tyre`."""

from bayes_tyre.cli import app

if __name__ == "__main__":
    app(prog_name="bayes-tyre")
