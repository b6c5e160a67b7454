"""Files appear whole or not at all, and devices stay what they are."""

from __future__ import annotations

import os
import re
import stat
from dataclasses import replace
from pathlib import Path

import pytest

from ttwmr_mj.assets import shipped_scenarios
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError
from ttwmr_mj.files import read_json, write_text, written
from ttwmr_mj.vision.calibration.file import load_calibration, save_calibration


def test_nothing_is_left_of_a_file_that_could_not_be_written(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    write_text(file, "good")

    def interrupted() -> None:
        with written(file) as temporary:
            temporary.write_text("ba")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]
    assert file.read_text() == "good"


def test_the_file_is_named_that_could_not_be_written(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError) as error:
        write_text(tmp_path / "no" / "a.json", "{}")
    assert error.value.filename == str(tmp_path / "no" / "a.json")


def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.json")
    with pytest.raises(OSError, match="Invalid argument"):
        read_json(tmp_path / "a.json")
    (tmp_path / "b.json").write_text("[1, 2]")
    with pytest.raises(ValueError, match=r"b\.json holds no object"):
        read_json(tmp_path / "b.json")


def test_a_device_is_written_to_and_not_replaced(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export-schema", "--out", "/dev/null"]) == 0
    assert main(["export-schema", "--out", "/dev/full"]) == 1
    assert "No space left on device" in capsys.readouterr().err
    assert all(stat.S_ISCHR(Path(f"/dev/{name}").stat().st_mode) for name in ("null", "full"))


@pytest.mark.parametrize(
    ("pattern", "by"),
    [
        (r"\n *cols: 3", ""),
        (r"rows: 3", "rows: 9"),
        (r"dt: d", "dt: u"),
        (r"!!opencv-matrix", "!!python/object"),
        (r"data: \[", "data: [ 1., "),
        (r"(rotation_world_to_camera:[^\[]*\[ *)", r"\1-"),  # neither a rotation nor a reflection
        (r"(camera_position_m:[^\[]*\[[^,]*,[^,]*,\s*)", r"\1-"),
        (r"(camera_matrix:[^\[]*\[ *)", r"\g<1>1e300"),
    ],
)
def test_a_strangers_calibration_is_checked_before_opencv_reads_it(
    pattern: str, by: str, tmp_path: Path
) -> None:
    folder = next(iter(shipped_scenarios().values())).parent / "calibration"
    good = next(folder.glob("*.yaml"))
    load_calibration(good)
    text, count = re.subn(pattern, by, good.read_text(), count=1)
    assert count == 1
    bad = tmp_path / "bad.yaml"
    bad.write_text(text)
    with pytest.raises(InputError, match=r"bad\.yaml"):
        load_calibration(bad)


def test_a_reflection_is_no_rotation(tmp_path: Path) -> None:
    folder = next(iter(shipped_scenarios().values())).parent / "calibration"
    good = load_calibration(next(folder.glob("*.yaml")))
    save_calibration(good, tmp_path / "good.yaml")
    load_calibration(tmp_path / "good.yaml")
    mirrored = replace(good.camera, rotation=-good.camera.rotation)
    save_calibration(replace(good, camera=mirrored), tmp_path / "bad.yaml")
    with pytest.raises(InputError, match="is not a rotation matrix"):
        load_calibration(tmp_path / "bad.yaml")
