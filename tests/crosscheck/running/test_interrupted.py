"""Ctrl-C in a session of the local scheduler (`test_dask` has that of the other)."""

from pathlib import Path

from tests.crosscheck.running.interrupted import install_plugs, interrupt_and_go_on


def test_an_interrupted_session_leaves_whole_records_and_goes_on(tmp_path: Path) -> None:
    plugs = tmp_path / "plugs"
    plugs.mkdir()
    interrupt_and_go_on(plugs, install_plugs(plugs), tmp_path)
