"""A scene of a few lines may ask for all memory and for hours: it is tried before it is read."""

from __future__ import annotations

import os
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from ttwmr_mj.assets import models_folder
from ttwmr_mj.errors import InputError
from ttwmr_mj.plants.model.contact_options import ContactOptions
from ttwmr_mj.plants.model.mjcf import build_model
from ttwmr_mj.plants.model.scene import trial
from ttwmr_mj.plants.model.settled import settled_qpos
from ttwmr_mj.robot import RobotParameters

ROBOT = RobotParameters()
ON_LINUX = pytest.mark.skipif(sys.platform != "linux", reason="memory is measured on Linux only")
REPLICATED = (
    '<worldbody><replicate count="1000"><replicate count="1000">'
    '<geom size="0.01" contype="0" conaffinity="0"/></replicate></replicate></worldbody>'
)


def scene(folder: Path, more: str) -> ContactOptions:
    text = (models_folder() / "scene.xml").read_text()
    text = text.replace('"ttwmr.xml"', f'"{models_folder() / "ttwmr.xml"}"')
    (folder / "scene.xml").write_text(text.replace("</mujoco>", f"{more}</mujoco>"))
    return ContactOptions(model_path=str(folder / "scene.xml"))


def textures(count: int, width: object, height: object, kind: str = "2d") -> str:
    looks = f'type="{kind}" builtin="flat" width="{width}" height="{height}"'
    each = (f'<texture name="t{i}" {looks}/>' for i in range(count))
    return f"<asset>{''.join(each)}</asset>"


LARGE = {
    "spaces": textures(1, " 25000", "+25000"),
    "cube": textures(1, 12_000, 1, "cube"),
    "skybox": textures(1, 12_000, 12, "skybox"),
    "many": textures(60, 5400, 5400),
    "user numbers": '<size nuser_geom="100000000"/>',
}


@ON_LINUX
@pytest.mark.parametrize("kind", LARGE)
def test_what_fills_the_memory_is_refused(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trial, "MOST_BYTES", 3e8)
    with pytest.raises(InputError) as refused:
        build_model(ROBOT, scene(tmp_path, LARGE[kind]))
    (fault,) = refused.value.faults
    assert fault.where == "plant.contact.model_path"
    assert "scene.xml" in fault.got
    assert fault.problem == "MuJoCo needs more than 0.3 GB of memory to compile it"
    assert "smaller" in fault.hint


@pytest.mark.parametrize("more", [REPLICATED, '<size nkey="10000000"/>'])
def test_what_goes_on_for_long_is_refused(
    more: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trial, "MOST_S", 0.5)
    with pytest.raises(InputError, match=r"more than 0.5 s of processor time to compile it"):
        build_model(ROBOT, scene(tmp_path, more))


def test_an_error_without_a_reason_is_the_scenes(tmp_path: Path) -> None:
    more = f'<asset><mesh name="m" builtin="supersphere" params="{2 * 10**9} 1 1"/></asset>'
    with pytest.raises(InputError, match="beyond all memory") as refused:
        build_model(ROBOT, scene(tmp_path, more))
    assert refused.value.faults[0].where == "plant.contact.model_path"


def test_a_crash_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trial, "_TRY", "import os; os._exit(7)")
    with pytest.raises(InputError, match="MuJoCo crashes as it compiles it: exit code 7"):
        build_model(ROBOT, scene(tmp_path, ""))


def test_a_scene_is_tried_once_as_long_as_it_stays(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried, run = list[object](), subprocess.run
    monkeypatch.setattr(subprocess, "run", lambda *a, **k: (tried.append(a), run(*a, **k))[1])
    options = scene(tmp_path, "")
    for _ in range(2):
        build_model(ROBOT, options)
    assert len(tried) == 1
    scene(tmp_path, '<statistic extent="2"/>')
    build_model(ROBOT, options)
    assert len(tried) == 2
    build_model(ROBOT, ContactOptions())  # the shipped one needs none
    assert len(tried) == 2


def write_mesh(file: Path, rings: int) -> int:
    """A bumpy ball of 4 · rings² triangles."""
    up, round_ = np.meshgrid(np.arange(rings + 1), np.arange(2 * rings + 1), indexing="ij")
    polar, angle = np.pi * up / rings, np.pi * (round_ % (2 * rings)) / rings
    radius = 0.1 + 0.02 * np.sin(5 * polar) * np.cos(7 * angle)
    out = np.stack([np.cos(angle), np.sin(angle)]) * np.sin(polar)
    points = np.moveaxis(radius * np.stack([*out, np.cos(polar)]), 0, -1).astype("<f4")
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    triangles = np.concatenate([np.stack([a, b, c], 2), np.stack([a, c, d], 2)]).reshape(-1, 9)
    rows = np.zeros(len(triangles), np.dtype([("n", "<f4", 3), ("p", "<f4", 9), ("a", "<u2")]))
    rows["p"] = triangles
    file.write_bytes(bytes(80) + struct.pack("<I", len(rows)) + rows.tobytes())
    return len(rows)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["height field", "textures", "meshes", "replicated"])
def test_a_rich_scene_is_accepted(kind: str, tmp_path: Path) -> None:
    assert write_mesh(tmp_path / "m.stl", 158) == 99_856
    meshes = "".join(f'<mesh name="m{i}" file="m.stl"/>' for i in range(3))
    balls = "".join(f'<geom type="mesh" mesh="m{i}" pos="3 {i} 1"/>' for i in range(3))
    more = {
        "height field": '<asset><hfield name="h" nrow="1000" ncol="1000" size="1 1 1 1"/></asset>'
        '<worldbody><geom type="hfield" hfield="h" pos="9 9 0"/></worldbody>',
        "textures": textures(10, 2048, 2048),
        "meshes": f"<asset>{meshes}</asset><worldbody>{balls}</worldbody>",
        "replicated": REPLICATED.replace("1000", "50"),
    }[kind]
    build_model(ROBOT, scene(tmp_path, more))


@pytest.mark.slow
def test_a_polite_end_ends_the_trial_too(tmp_path: Path) -> None:
    options = scene(tmp_path, '<size nkey="10000000"/>')
    command = [sys.executable, "-m", "ttwmr_mj", "validate", "lab_circle"]
    process = subprocess.Popen(
        [*command, "--set", f"plant.contact.model_path={options.model_path}"],
        stderr=subprocess.PIPE,
        text=True,
    )
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    end_s = time.monotonic() + 60
    while not (child := children.read_text().split()) and time.monotonic() < end_s:
        time.sleep(0.05)
    os.kill(process.pid, signal.SIGTERM)
    _, told = process.communicate(timeout=20)
    assert process.returncode == 1, told
    assert "stopped" in told
    assert not Path(f"/proc/{child[0]}").exists()


@pytest.mark.slow
def test_slow_physics_answers_signals(tmp_path: Path) -> None:
    boxes = "".join(
        f'<body pos="{3 + 0.2 * (i % 10)} {0.2 * (i // 10)} 0.06"><freejoint/>'
        '<geom type="box" size="0.05 0.05 0.05"/></body>'
        for i in range(100)
    )
    model = build_model(ROBOT, scene(tmp_path, f"<worldbody>{boxes}</worldbody>"))
    answered = list[int]()
    before = signal.signal(signal.SIGALRM, lambda number, _: answered.append(number))
    signal.setitimer(signal.ITIMER_REAL, 0.02, 0.02)
    try:
        settled_qpos([model], [True], 1, leans=False)  # takes seconds
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert len(answered) > 5  # in one call of MuJoCo: once, after it
