"""JAX's settings, made once by a command before anything computes: float64, and a host device for each chain."""


def prepare_jax(devices: int = 1) -> None:
    """Switch JAX to float64 and split the host into `devices`, so that as many chains run side by side.

    Call it before the first computation: the number of devices is fixed when JAX starts. Where JAX has started
    already, the devices stay as they are (chains then run one after another) and only float64 is set.
    """
    import jax

    jax.config.update("jax_enable_x64", True)
    try:
        jax.config.update("jax_num_cpu_devices", devices)
    except RuntimeError as error:
        if "backends" not in str(error):
            raise
