"""Kernels compiled in a process beside this one."""

from __future__ import annotations

import subprocess
import sys

import pytest

from pivident.app.cli import compile_ahead as ahead
from pivident.dynamics import forward, regressor_kernels
from pivident.estimation import normal_equations
from pivident.foundation.compiled import is_compiled
from pivident.loop.simulation import loop_kernel
from pivident.signals import burg, prefilter, random_walk_likelihood


def test_nothing_is_started_where_everything_is_compiled(monkeypatch):
    monkeypatch.setattr(ahead, "is_compiled", lambda kernel: True)
    monkeypatch.setattr(subprocess, "Popen", lambda *_, **__: pytest.fail("a process"))
    ahead.compile_ahead()


def test_a_process_is_started_where_a_kernel_is_missing(monkeypatch):
    started, ended = [], []
    monkeypatch.setattr(ahead, "is_compiled", lambda kernel: False)
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: started.append(command))
    monkeypatch.setattr(ahead.atexit, "register", lambda *call: ended.append(call))
    ahead.compile_ahead()
    assert started == [[sys.executable, "-m", "pivident.app.cli.compile_ahead"]]
    assert ended == [(ahead._end, None)]


def test_the_loop_counts_only_where_it_is_simulated(monkeypatch):
    monkeypatch.setattr(ahead, "is_compiled", lambda kernel: kernel is not loop_kernel.run_loop)
    monkeypatch.setattr(ahead.atexit, "register", lambda *call: None)
    started = []
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: started.append(command))
    ahead.compile_ahead(simulated=False)
    assert not started
    ahead.compile_ahead(simulated=True)
    assert started


def test_it_leaves_the_shared_kernels_in_the_cache():
    ahead.compile_shared()
    kernels = (
        regressor_kernels.observe,
        loop_kernel.run_loop,
        forward._mass_matrices,
        burg.products,
        prefilter._filter_group,
        random_walk_likelihood._search,
        normal_equations._add_products,
    )
    assert [kernel.__name__ for kernel in kernels if not is_compiled(kernel)] == []


def test_the_first_command_says_what_it_waits_for(monkeypatch, capsys):
    started = []
    monkeypatch.setattr(ahead, "is_compiled", lambda kernel: False)
    monkeypatch.setattr(ahead, "compile_ahead", lambda: started.append(True))
    ahead.compile_in_first_run()
    said = capsys.readouterr().err
    assert started and "Compiling for this computer takes about 12 s, in this first run" in said
    monkeypatch.setattr(ahead, "is_compiled", lambda kernel: True)
    ahead.compile_in_first_run()
    assert len(started) == 1 and not capsys.readouterr().err
