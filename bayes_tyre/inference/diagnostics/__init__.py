"""Whether a posterior may be trusted: convergence, data checks, prior sensitivity, leave-one-out, the verdict."""
