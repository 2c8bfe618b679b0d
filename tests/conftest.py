"""Every test runs in float64 with jaxtyping checked by beartype; both are set before anything imports jax."""

import os

from jaxtyping import install_import_hook

os.environ["JAX_ENABLE_X64"] = "1"
os.environ["JAX_NUMPY_DTYPE_PROMOTION"] = "standard"
os.environ["XLA_FLAGS"] = os.environ.get("XLA_FLAGS", "") + " --xla_force_host_platform_device_count=4"
install_import_hook("bayes_tyre", "beartype.beartype")
