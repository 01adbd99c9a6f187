"""The README's animation comes from a real run, is small, and moves."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from nightly import nightly
from PIL import Image

PICTURES = Path(__file__).parents[2] / "docs" / "pictures"


def frames_of(path: Path) -> list[bytes]:
    with Image.open(path) as picture:
        count = int(getattr(picture, "n_frames", 1))
        found = []
        for index in range(count):
            picture.seek(index)
            found.append(picture.convert("RGB").tobytes())
    return found


def test_the_animation_is_small_and_no_frame_repeats() -> None:
    assert (PICTURES / "palpation.gif").stat().st_size <= 500_000
    frames = frames_of(PICTURES / "palpation.gif")
    assert len(set(frames)) == len(frames) == 40


@nightly
def test_the_script_draws_the_animation(tmp_path: Path) -> None:
    subprocess.run([sys.executable, PICTURES / "animate.py", tmp_path / "again.gif"], check=True)
    assert len(frames_of(tmp_path / "again.gif")) == 40
