"""`ttwmr doctor` on machines that lack something."""

from __future__ import annotations

import os
from pathlib import Path
from types import SimpleNamespace

import pytest

from ttwmr_mj.cli.main import main
from ttwmr_mj.runs.process import machine


def test_a_machine_with_everything(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "lvp_icd.json").write_text("{}")
    monkeypatch.setattr(machine, "VULKAN_DRIVERS", (tmp_path,))
    monkeypatch.setattr("ctypes.util.find_library", lambda name: f"lib{name}.so.1")
    monkeypatch.setattr(machine, "probe", lambda _: SimpleNamespace(renderer="llvmpipe", fault=""))
    text, healthy = machine.examine()
    assert healthy
    assert "libvulkan.so.1, drivers: lvp_icd.json" in text
    assert "install" not in text
    assert [line for line in text.splitlines()[1:] if line and not line.startswith(" ")] == [
        f"processors: {os.cpu_count()}",
        "Libraries",
        "Extras, each for what it is named after",
        "OpenGL, to render camera frames (not needed with truth sensing)",
        "Display, for windows (not needed to record)",
        "Vulkan, for the Rerun viewer (not needed to record)",
    ]


def test_what_is_missing_is_named_with_how_to_install_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(machine, "VULKAN_DRIVERS", (tmp_path,))
    monkeypatch.setattr("ctypes.util.find_library", lambda _: None)
    monkeypatch.setattr(
        machine, "probe", lambda _: SimpleNamespace(renderer=None, fault="no display")
    )
    absent = {"numpy", "tqdm", "casadi"}

    def imported(name: str) -> SimpleNamespace:
        if name in ("cv2", "sympy"):
            raise ImportError(f"lib{name}.so.1")
        return SimpleNamespace(__file__=None if name == "scipy" else f"{name}.py")

    monkeypatch.setattr(machine, "import_module", imported)
    monkeypatch.setattr(machine, "library_version", lambda name: None if name in absent else "1.0")
    assert main(["doctor"]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert "  numpy                    MISSING" in lines
    assert "  mujoco                   1.0" in lines
    assert "  opencv-python-headless CANNOT BE IMPORTED: ImportError: libcv2.so.1" in lines
    assert "  scipy CANNOT BE IMPORTED: its folder holds no code" in lines
    assert "  install them: pip install numpy opencv-python-headless scipy tqdm" in lines
    wrong = "  reproduce   sympy          1.0, but cannot be imported: ImportError: libsympy.so.1"
    assert wrong in lines
    assert "  planning    casadi         missing: pip install 'ttwmr-mj[planning]'" in lines
    assert "  video       imageio-ffmpeg 1.0" in lines
    assert "  camera frames: no" in lines
    assert "  egl      does not work: no display" in lines
    assert any(line.startswith("  install it: apt-get install lib") for line in lines)
    assert "  no loader, drivers: none" in lines
    assert "  install it: apt-get install libvulkan1 mesa-vulkan-drivers" in lines


def test_a_missing_renderer_is_no_illness(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine, "probe", lambda _: SimpleNamespace(renderer=None, fault="x"))
    assert machine.examine()[1]


def test_one_renderer_that_works_is_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    by_osmesa = {"osmesa": SimpleNamespace(renderer="llvmpipe", fault="")}
    none = SimpleNamespace(renderer=None, fault="x")
    monkeypatch.setattr(machine, "probe", lambda backend: by_osmesa.get(backend, none))
    lines = machine.examine()[0].splitlines()
    assert "  camera frames: yes, by osmesa; one that works is enough" in lines
    assert "  osmesa   llvmpipe" in lines
