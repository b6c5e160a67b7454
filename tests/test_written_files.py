"""Files appear whole or not at all, and devices stay what they are."""

from __future__ import annotations

import errno
import os
import re
import socket
import stat
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest

from ttwmr_mj.assets import shipped_scenarios
from ttwmr_mj.cli.main import main
from ttwmr_mj.errors import InputError
from ttwmr_mj.files import clear, read_json, write_text, written
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


def test_two_writers_of_one_file_do_not_meet(tmp_path: Path) -> None:
    file = tmp_path / "a.txt"
    with written(file) as first, written(file) as second:
        first.write_text("first")
        second.write_text("second")
    assert file.read_text() == "first"  # who is ready last
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_the_file_is_named_that_found_no_room(tmp_path: Path) -> None:
    """What writes to an open file does not know its name."""
    with pytest.raises(OSError, match=r"a\.json") as error, written(tmp_path / "a.json"):
        Path("/dev/full").write_text("too much", encoding="utf-8")
    assert error.value.errno == errno.ENOSPC


def test_a_pipe_is_not_waited_for_and_a_folder_is_called_one(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "a.json")
    with pytest.raises(OSError, match="Invalid argument"):
        read_json(tmp_path / "a.json")
    with pytest.raises(OSError, match="Is a directory"):
        read_json(tmp_path)
    (tmp_path / "b.json").write_text("[1, 2]")
    with pytest.raises(ValueError, match=r"b\.json holds no object"):
        read_json(tmp_path / "b.json")


@pytest.mark.parametrize("number", ["NaN", "-Infinity", "1e999", "9" * 30, "1" + "0" * 5000])
def test_numbers_that_no_file_of_ours_holds_are_refused(number: str, tmp_path: Path) -> None:
    (tmp_path / "a.json").write_text(f'{{"a": [1, -2.5e3, {2**63 - 1}]}}')
    assert read_json(tmp_path / "a.json") == {"a": [1, -2500.0, 2**63 - 1]}
    (tmp_path / "a.json").write_text(f'{{"a": [{number}]}}')
    with pytest.raises(ValueError, match=r"finite number|64 bits|digits"):
        read_json(tmp_path / "a.json")
    (tmp_path / "a.json").write_text("[" * 100_000)
    with pytest.raises(ValueError, match="too deep"):
        read_json(tmp_path / "a.json")


def looped(path: Path) -> None:
    path.symlink_to(path.name)


def socket_at(path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as one:
        one.bind(str(path))


@pytest.mark.parametrize("make", [os.mkfifo, looped, socket_at])
def test_what_nobody_reads_is_replaced(make: Callable[[Path], None], tmp_path: Path) -> None:
    file = tmp_path / "a.json"
    make(file)
    write_text(file, "whole")
    assert file.is_file()
    assert not file.is_symlink()
    assert file.read_text() == "whole"


@contextmanager
def opened_by_both(pipe: Path) -> Iterator[None]:
    """Once the reader waits for a writer: another end held open, so that it stays."""
    while True:
        try:
            end = os.open(pipe, os.O_WRONLY | os.O_NONBLOCK)
        except OSError:
            time.sleep(0.01)
        else:
            break
    yield
    os.close(end)


def test_a_pipe_that_somebody_reads_is_written_to(tmp_path: Path) -> None:
    pipe = tmp_path / "a.json"
    os.mkfifo(pipe)
    with subprocess.Popen(["cat", str(pipe)], stdout=subprocess.PIPE, text=True) as reader:
        with opened_by_both(pipe):
            assert main(["export-schema", "--out", str(pipe)]) == 0
        said, _ = reader.communicate(timeout=60)
    assert said.startswith("{")
    assert said.endswith("}\n")
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_a_folder_is_not_replaced_by_a_file(tmp_path: Path) -> None:
    (tmp_path / "a.json").mkdir()
    with pytest.raises(IsADirectoryError) as error:
        write_text(tmp_path / "a.json", "{}")
    assert error.value.filename == str(tmp_path / "a.json")
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]


def test_stdout_that_nobody_reads_any_longer_is_not_waited_for() -> None:
    ttwmr = Path(sys.executable).with_name("ttwmr")
    words = [ttwmr, "export-schema", "--out", "/dev/stdout"]
    source, end = os.pipe()
    os.close(source)
    try:
        done = subprocess.run(words, stdout=end, stderr=subprocess.PIPE, timeout=60, check=False)
    finally:
        os.close(end)
    assert (done.returncode, done.stderr) == (0, b"")
    assert Path("/dev/stdout").is_symlink()


def test_an_emptied_folder_spares_what_links_lead_to(tmp_path: Path) -> None:
    (tmp_path / "precious").mkdir()
    (tmp_path / "precious" / "a.txt").write_text("kept")
    for make in (
        lambda path: path.symlink_to("precious"),
        lambda path: (path / "inner").mkdir(parents=True),
        lambda path: path.write_text("a file"),
        looped,
        os.mkfifo,
    ):
        folder = tmp_path / "out"
        make(folder)
        clear(folder)
        assert folder.is_dir()
        assert not folder.is_symlink()
        assert not any(folder.iterdir())
        folder.rmdir()
    assert (tmp_path / "precious" / "a.txt").read_text() == "kept"


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
