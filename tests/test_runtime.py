"""JAX's compilation cache serves the next run, and no state of its folder disturbs a run."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import jax
import pytest
from helpers.command_line import environment

from bayes_tyre import runtime

SCRIPT = """
from bayes_tyre.cli.messages import one_line_each
from bayes_tyre.runtime import prepare_jax
with one_line_each():
    prepare_jax(2)
    import jax
    import jax.numpy as jnp
    print(jax.device_count(), jax.jit(lambda x: jnp.sin(x) + 1.0)(jnp.zeros(3)).sum())
"""


def run(cache: Path, **more: str) -> subprocess.CompletedProcess[str]:
    env = {name: value for name, value in environment().items() if not name.startswith("JAX_")}
    env |= {"XDG_CACHE_HOME": str(cache)} | more
    return subprocess.run([sys.executable, "-c", SCRIPT], env=env, capture_output=True, text=True)


def entries(cache: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in cache.rglob("*-cache")}


def assert_undisturbed(done: subprocess.CompletedProcess[str], devices: int = 2) -> None:
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{devices} 3.0\n", "")


def test_compiled_code_is_kept_and_torn_entries_are_replaced(tmp_path):
    assert_undisturbed(run(tmp_path))
    kept = entries(tmp_path)
    assert kept
    for path, whole in kept.items():
        path.write_bytes(whole[: len(whole) // 2])
    assert_undisturbed(run(tmp_path))
    assert entries(tmp_path).keys() == kept.keys()
    assert all(len(entry) > len(kept[path]) // 2 for path, entry in entries(tmp_path).items())


def test_an_entry_torn_while_a_run_is_under_way_is_passed_over(tmp_path):
    assert_undisturbed(run(tmp_path))
    kept = entries(tmp_path)
    tear = "".join(f"open({str(path)!r}, 'wb').write(b'x'); " for path in kept)
    script = SCRIPT.replace("    import jax\n", f"    import jax; {tear}\n", 1)
    env = {name: value for name, value in environment().items() if not name.startswith("JAX_")}
    command = [sys.executable, "-c", script]
    assert_undisturbed(
        subprocess.run(command, env=env | {"XDG_CACHE_HOME": str(tmp_path)}, capture_output=True, text=True)
    )


@pytest.mark.parametrize("off", ["off", "elsewhere", "no folder"])
def test_jaxs_own_variables_and_a_folder_that_cannot_be_are_heeded(off, tmp_path):
    cache, more = tmp_path / "cache", {}
    if off == "off":
        more = {"JAX_ENABLE_COMPILATION_CACHE": "0"}
    elif off == "elsewhere":
        more = {"JAX_COMPILATION_CACHE_DIR": str(tmp_path / "mine")}
    else:
        cache.write_text("a file")
    assert_undisturbed(run(cache, **more))
    assert not cache.is_dir()
    assert (tmp_path / "mine").is_dir() == (off == "elsewhere")


def test_the_number_of_devices_that_jaxs_own_variable_asks_for_is_heeded(tmp_path):
    assert_undisturbed(run(tmp_path, JAX_NUM_CPU_DEVICES="3"), devices=3)


def test_options_that_this_compiler_does_not_know_are_left_out(monkeypatch):
    assert runtime.run_often() == runtime._WITHOUT_YNN
    monkeypatch.setattr(runtime, "_WITHOUT_YNN", {"xla_no_such_option": ""})
    assert runtime.run_often.__wrapped__() == {}


@pytest.mark.parametrize("backend", ["gpu", "cpu"])
def test_a_gpu_is_what_jax_computes_on(backend, monkeypatch):
    monkeypatch.setattr(jax, "default_backend", lambda: backend)
    assert runtime.finds_gpu() == (backend == "gpu")


def test_the_processor_is_used_where_it_is_asked_for(tmp_path):
    env = {name: value for name, value in environment().items() if not name.startswith("JAX_")}
    script = SCRIPT.replace("prepare_jax(2)", "prepare_jax(2, 'cpu')").replace(
        "print(", "print(jax.config.jax_platforms, jax.default_backend(), "
    )
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, env=env | {"XDG_CACHE_HOME": str(tmp_path)}, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "cpu cpu 2 3.0\n", "")


@pytest.mark.parametrize(("most", "left"), [(0.0, 0), (1.0, 1)], ids=["full", "room"])
def test_compiled_code_is_dropped_where_it_fills_the_maps(most, left, monkeypatch):
    doubled: Any = jax.jit(lambda x: 2 * x)
    doubled(1.0)
    monkeypatch.setattr(runtime, "_HELD_MOST", most)
    runtime.drop_code_where_full()
    assert doubled._cache_size() == left
    assert doubled(2.0) == 4.0


@pytest.mark.parametrize(
    ("resident_gb", "cores", "dropped"),
    [(2.4, 64, []), (2.6, 64, [True]), (7.9, 2, []), (8.1, 2, [True])],
    ids=["small", "more than a core of many has", "room", "full"],
)
def test_compiled_code_is_dropped_where_it_fills_a_cores_memory(resident_gb, cores, dropped, monkeypatch, tmp_path):
    """A machine of 32 GB: half of it among two cores is 8 GB each, and among many 2.5 GB all the same."""
    page = 4096
    (tmp_path / "statm").write_text(f"9999999 {int(resident_gb * 1e9 / page)} 300\n")
    monkeypatch.setattr(runtime, "_MAPS", tmp_path / "none")
    monkeypatch.setattr(runtime, "_STATM", tmp_path / "statm")
    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    monkeypatch.setattr(os, "sysconf", {"SC_PHYS_PAGES": int(32e9 / page), "SC_PAGE_SIZE": page}.get)
    calls = []
    monkeypatch.setattr(jax, "clear_caches", lambda: calls.append(True))
    runtime.drop_code_where_full()
    assert calls == dropped


def test_without_maps_and_memory_to_count_compiled_code_stays(monkeypatch, tmp_path):
    monkeypatch.setattr(runtime, "_MAPS", tmp_path / "none")
    monkeypatch.setattr(runtime, "_STATM", tmp_path / "none")
    dropped = []
    monkeypatch.setattr(jax, "clear_caches", lambda: dropped.append(True))
    runtime.drop_code_where_full()
    assert dropped == []
